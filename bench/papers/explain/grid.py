"""The table behind an explanation: what every single switch makes of a cell."""

import math

from bench.papers.explain.switches import Explained
from bench.reporting.tables.grid import ABSENT, Cell, Grid, abbreviated


def explained_grid(explained: Explained) -> Grid:
    """A row for each switch, those that come closest first; the closest is bold where it helps."""

    def gap(value: float) -> float:
        return value if math.isfinite(value) else math.inf

    rows = sorted(explained.rows, key=lambda row: gap(row.gap_after))
    closest = min((gap(row.gap_after) for row in rows), default=math.inf)
    return Grid(
        caption=f"{explained.scene} / {explained.column}: measured {explained.measured:.3f} "
        f"({explained.alignment} alignment), published {explained.published}; every row changes one thing",
        facts=("switch", "from", "to"),
        methods=(("measured", ""), ("gap before", ""), ("gap after", ""), ("change", "")),
        rows=tuple(
            (
                (row.switch, row.before, row.after),
                (
                    Cell(
                        _number(row.measured) if math.isfinite(row.measured) else abbreviated(row.status),
                        row.gap_after == closest < row.gap_before,
                    ),
                    Cell(_number(row.gap_before)),
                    Cell(_number(row.gap_after)),
                    Cell(_number(row.gap_after - row.gap_before, "+")),
                ),
            )
            for row in rows
        ),
        notes=(explained.sentence(),),
    )


def _number(value: float, sign: str = "") -> str:
    if not math.isfinite(value):
        return ABSENT
    return f"{round(value, 3) or 0:{sign if round(value, 3) else ''}.3f}".replace("-", "−")
