"""What a trained method is worth on held-out graphs as text."""

from collections.abc import Sequence

from bench.core.words import counted
from bench.reporting.tables.grid import Cell, Grid
from bench.reporting.tables.printed import degrees
from bench.training.validation import FAR_DEG, Standing

HEADS = ("mean", "median", f"over {FAR_DEG:g}°", "ratio", "95 % interval", "verdict")


def validation_grid(rows: Sequence[Standing], graphs: int) -> Grid:
    """A row for the trained method and for each that it is judged beside."""
    return Grid(
        caption=f"On {counted(graphs, 'held-out graph')}; means over graphs, degrees, l1 alignment",
        facts=("Method",),
        methods=tuple((head, "") for head in HEADS),
        rows=tuple(((row.label,), _cells(row)) for row in rows),
        notes=(
            f"Ratio: {rows[0].label} to this method, of the median errors, geometric mean over the graphs; below 1 the "
            "trained one is better.",
        ),
    )


def _cells(row: Standing) -> tuple[Cell, ...]:
    ratio = row.ratio
    compared = ("", "") if ratio is None else (f"{ratio.value:.2f}", f"{ratio.low:.2f} to {ratio.high:.2f}")
    texts = (degrees(row.mean_deg), degrees(row.median_deg), f"{100 * row.far:.1f} %", *compared, row.verdict)
    return tuple(map(Cell, texts))
