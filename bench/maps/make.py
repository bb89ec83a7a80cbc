"""Make a phase map: from what a user wrote to a sweep, and from the map to its files."""

from collections.abc import Callable, Sequence
from pathlib import Path

from bench.maps.axes import parse_axis, parse_cells
from bench.maps.bounds import limits
from bench.maps.criterion import parse_criterion
from bench.maps.sweep import PhaseMap, Sweep
from bench.plugins.catalog import catalog


def read_sweep(
    methods: Sequence[str],
    dataset: str,
    axes: tuple[str, str],
    cells: str,
    seeds: int,
    success: str,
    alignment: str,
    plugins: Sequence[Path] = (),
) -> Sweep:
    """What a map is of, from texts; see `bench.maps.axes` and `bench.maps.criterion` for their forms.

    Raises
    ------
    InputError
        Where one of them is of another form, or names something unknown.
    """
    count_x, count_y = parse_cells(cells)
    info, _ = catalog("dataset", plugins).one(dataset)
    x, y = parse_axis(axes[0], count_x, info), parse_axis(axes[1], count_y, info)
    return Sweep(tuple(methods), dataset, x, y, seeds, parse_criterion(success), alignment)


def write(phase_map: PhaseMap, folder: Path, name: str, tell: Callable[[str], None] = lambda _: None) -> list[Path]:
    """Draw a map with the limits of theory, and keep its cells as CSV; what it shows is told in words."""
    from bench.maps.drawing import draw, summary
    from bench.reporting.figures.style import save

    sweep, layers = phase_map.sweep, phase_map.layers()
    for line in summary(layers, sweep.seeds):
        tell(line)
    share = f"{phase_map.taken} of the full grid's {phase_map.grid} solves ({phase_map.taken / phase_map.grid:.1%})"
    tell(f"{share}; success: {sweep.success}, {sweep.alignment} alignment")
    found = limits(sweep.shape, phase_map.problems(), tell)
    caption = (
        f"{sweep.dataset}; success: {sweep.success} ({sweep.alignment} alignment) in most of {sweep.seeds} seeds. "
        "Blue: success, orange: failure, faint: expected from the nearest sampled cell. "
        f"Dots: samples, {share}. Black: the boundary."
    )
    figure = draw(layers, (sweep.x, sweep.y), sweep.success, found, "Where methods break down", caption)
    paths = [*save(figure, folder, name), folder / f"{name}.csv"]
    phase_map.frame().to_csv(paths[-1], index=False)
    return paths
