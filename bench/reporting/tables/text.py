"""A grid with the frame behind it, as text in any of the formats."""

from typing import TYPE_CHECKING

from bench.reporting.tables.console import render_grid
from bench.reporting.tables.grid import Grid, markdown
from bench.reporting.tables.latex import latex

if TYPE_CHECKING:
    import pandas as pd


def text_of(
    grid: Grid, frame: "pd.DataFrame", style: str, *, width: int = 100, terminal: bool = False
) -> tuple[str, tuple[str, ...]]:
    """The table as console, markdown, csv or latex text, and the notes that are not in it (for csv all)."""
    if style == "csv":
        return frame.to_csv(index=False), grid.notes
    if style == "console":
        return render_grid(grid, width=width, terminal=terminal), ()
    return (markdown if style == "markdown" else latex)([grid]), ()
