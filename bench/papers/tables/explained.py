"""The table behind an explanation: what every single switch makes of a cell."""

import math

from bench.papers.explain import Explained
from bench.reporting.tables.grid import ABSENT, Cell, Grid, abbreviated


def explained_grid(explained: Explained, alignment: str) -> Grid:
    """A row for each switch, those that come closest first; the closest is bold where it helps."""
    rows = explained.rows.sort_values("gap_after", kind="stable")
    closest = rows["gap_after"].min()
    return Grid(
        caption=f"{explained.scene} / {explained.column}: measured {explained.measured:.3f} ({alignment} alignment), "
        f"published {explained.published}; every row changes one thing",
        facts=("switch", "from", "to"),
        methods=(("measured", ""), ("gap before", ""), ("gap after", ""), ("change", "")),
        rows=tuple(
            (
                (str(row.switch), str(row.before), str(row.after)),
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
            for row in rows.itertuples()
        ),
        notes=(explained.sentence(),),
    )


def _number(value: float, sign: str = "") -> str:
    if not math.isfinite(value):
        return ABSENT
    return f"{round(value, 3) or 0:{sign if round(value, 3) else ''}.3f}".replace("-", "−")
