"""``bench map``: where, over two parameters of a dataset, each method breaks down."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import Align, DataDirOption, PluginOption
from bench.running.progress.live import execute

if TYPE_CHECKING:
    import pandas as pd

    from bench.maps.sweep import PhaseMap

EPILOG = (
    "Example: python -m bench map -m l1-irls -m spectral "
    "-d 'erdos-renyi[n=100,noise=langevin]' --x missing=0:0.9 --y outliers=0:0.9"
)
NAME = "map"


def map_(
    method: Annotated[list[str], typer.Option("--method", "-m", metavar="M", help="Repeat for more.")],
    x: Annotated[str, typer.Option("--x", metavar="AXIS", help="NAME=FROM:TO[:log], a parameter of the dataset.")],
    y: Annotated[str, typer.Option("--y", metavar="AXIS", help="The same, another parameter.")],
    dataset: Annotated[str, typer.Option("--dataset", "-d", metavar="D", help="What stays the same.")] = "erdos-renyi",
    cells: Annotated[str, typer.Option(metavar="N", help="Cells a side, or along x and y: 16x12.")] = "12",
    seeds: Annotated[int, typer.Option(metavar="N", help="Samples of a cell at most; the majority counts.")] = 3,
    success: Annotated[
        str,
        typer.Option(
            metavar="BOUND",
            help="Success is a median error below that many degrees, or (2x) that many times what is possible.",
        ),
    ] = "5",
    budget_solves: Annotated[int | None, typer.Option(metavar="N", help="Stop after that many solves.")] = None,
    full: Annotated[bool, typer.Option("--full", help="Solve the full grid instead.")] = False,
    against: Annotated[
        Path | None, typer.Option(metavar="CSV", help="Cells of another map on these axes: how far apart are they?")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder.  [default: results/runs/map]")] = None,
    align: Annotated[Align, typer.Option(help="Rule that removes the gauge.")] = Align.L1,
    data_dir: DataDirOption = None,
    jobs: Annotated[int | None, typer.Option(metavar="N", help="Jobs at a time.  [default: one a core]")] = None,
    timeout: Annotated[float | None, typer.Option(metavar="S", help="Wall clock seconds of one job.")] = None,
    memory: Annotated[float | None, typer.Option(metavar="GIB", help="Resident memory of one job.")] = None,
    plugin: PluginOption = None,
) -> None:
    """Map where methods break down, solving mostly along the boundary.

    A coarse lattice first; then cells between neighbours that disagree, and further seeds where the outcome is
    unsure. What is stored is not solved again: after Ctrl-C, the same command continues. An `n` and a `noise_deg`
    make an axis as well as `missing` and `outliers`.
    """
    from bench.core.errors import InputError
    from bench.maps.axes import parse_axis, parse_cells
    from bench.maps.criterion import parse_criterion
    from bench.maps.sweep import PhaseMap, Sweep, one_dataset
    from bench.running.run import RUNS_FOLDER, Options

    plugins = tuple(plugin or ())
    if budget_solves is not None and budget_solves < 1:
        raise InputError(f"--budget-solves must be above zero, not {budget_solves}")
    count_x, count_y = parse_cells(cells)
    info, _ = one_dataset(dataset, plugins)
    axes = parse_axis(x, count_x, info), parse_axis(y, count_y, info)
    sweep = Sweep(tuple(method), dataset, *axes, seeds, parse_criterion(success), align.value)
    folder = out or RUNS_FOLDER / NAME
    options = Options(out=folder, data_dir=data_dir, jobs=jobs, timeout_s=timeout, memory_gib=memory, plugins=plugins)
    phase_map = PhaseMap(sweep, options)
    other = _read(against, phase_map) if against else None
    typer.echo(
        f"map of {axes[0].parameter} x {axes[1].parameter}: {phase_map.grid} solves in the full grid -> {folder}"
    )
    complete = phase_map.explore(execute, full=full, budget=budget_solves, tell=typer.echo)
    _present(phase_map, folder, full)
    if not complete:
        typer.echo("the budget ended before every boundary was known; a larger --budget-solves continues")
    if other is not None:
        _tell_apart(phase_map, other)


def _present(phase_map: "PhaseMap", folder: Path, full: bool) -> None:
    from bench.maps.bounds import limits
    from bench.maps.drawing import draw, summary
    from bench.reporting.figures.style import save

    sweep = phase_map.sweep
    frame = phase_map.frame()
    for line in summary(frame, sweep.seeds):
        typer.echo(line)
    share = f"{phase_map.taken} of the full grid's {phase_map.grid} solves ({phase_map.taken / phase_map.grid:.1%})"
    typer.echo(f"{share}; success: {sweep.success}, {sweep.alignment} alignment")
    found = limits(sweep.shape, phase_map.problems(), typer.echo)
    caption = (
        f"{sweep.dataset}; success: {sweep.success} ({sweep.alignment} alignment) in most of {sweep.seeds} seeds. "
        "Blue: success, orange: failure, faint: expected from the nearest sampled cell. "
        f"Dots: samples, {share}. Black: the boundary."
    )
    axes = sweep.x, sweep.y
    figure = draw(frame, axes, sweep.success, found, "Where methods break down", caption)
    name = "map-full" if full else "map"
    paths = save(figure, folder / "maps", name)
    paths.append(folder / "maps" / f"{name}.csv")
    frame.to_csv(paths[-1], index=False)
    for path in paths:
        typer.echo(path)


def _read(path: Path, phase_map: "PhaseMap") -> "pd.DataFrame":
    """Cells of another map, checked to be on the same axes."""
    import pandas as pd

    from bench.core.errors import InputError

    try:
        other = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise InputError(f"--against {path} cannot be read as a map: {error}") from error
    if missing := {"method", "success"} - set(other.columns):
        raise InputError(f"--against {path} is no map: it has no column '{sorted(missing)[0]}'")
    for axis in (phase_map.sweep.x, phase_map.sweep.y):
        values = tuple(sorted(set(other.get(axis.parameter, ()))))
        if values != axis.values:
            raise InputError(f"--against {path} has other values of '{axis.parameter}' than this map")
    return other


def _tell_apart(phase_map: "PhaseMap", other: "pd.DataFrame") -> None:
    import numpy as np

    from bench.maps.adaptive import farthest
    from bench.maps.drawing import successes

    axes = phase_map.sweep.x, phase_map.sweep.y
    ours, theirs = successes(phase_map.frame(), axes), successes(other, axes)
    for method in (m for m in ours if m in theirs):
        same = np.mean(ours[method] == theirs[method])
        typer.echo(
            f"{method}: boundaries at most {farthest(ours[method], theirs[method]):g} cells apart, "
            f"{same:.1%} of the cells agree"
        )
