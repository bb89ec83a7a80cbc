"""Tables of a scored run: for the terminal, for Markdown, for a paper, and the long one for a spreadsheet."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import pandas as pd

from bench.core.errors import InputError, suggestion
from bench.reporting.tables.rows import Ties

if TYPE_CHECKING:
    from bench.reporting.tables.grid import Grid

By = Literal["scene", "collection"]
FORMATS = ("console", "markdown", "csv", "latex")
COLUMNS = (
    "dataset",
    "instance",
    "method",
    "params",
    "seed",
    "protocol",
    "alignment",
    "outcome",
    "status",
    "mean_deg",
    "median_deg",
    "solve_s",
    "peak_mib",
    "n_cameras",
    "n_solved",
    "n_scored",
)


def render(
    frame: pd.DataFrame,
    ties: Ties,
    footnotes: Sequence[str],
    style: str = "console",
    *,
    by: By = "scene",
    width: int = 100,
    terminal: bool = False,
) -> tuple[str, tuple[str, ...]]:
    """Draw a scored run as a table.

    Parameters
    ----------
    frame
        Scored rows, one for each (scene, method, params, seed), with at least `COLUMNS` and ``title``. Used
        where present: ``p90_deg, within_5_deg, within_10_deg, auc_1_deg, auc_5_deg, auc_10_deg, residual_mean_deg,
        residual_median_deg, edges_percent, hardness, roc_auc, collection, notes`` and ``timing`` (True on rows of a
        timing run, which then have ``rounds, baseline, min_s, speedup, speedup_low, speedup_high`` too).
    ties
        For each (dataset, instance, protocol) the (method, params) that cannot be told apart from the best.
    footnotes
        What a reader must know.
    style
        One of `FORMATS`. ``csv`` is the long table, unrounded, `COLUMNS` first; the others draw seeds
        together.
    by
        A table of every scene, or of means over the scenes of every collection.
    width, terminal
        Columns of the console, and whether it understands escape codes.

    Returns
    -------
    tuple
        The text, and the footnotes that are not in it (all of them for ``csv``, none otherwise).

    Raises
    ------
    InputError
        On an unknown format.
    """
    if by == "collection":
        return _by_collection(frame, ties, footnotes, style, width, terminal)
    if style == "csv":
        ordered = [*COLUMNS, *(name for name in frame.columns if name not in COLUMNS)]
        return frame[ordered].to_csv(index=False), tuple(footnotes)
    if style == "console":
        from bench.reporting.tables.console import render_console

        return render_console(frame, ties, footnotes, width=width, terminal=terminal), ()
    if style in ("markdown", "latex"):
        from bench.reporting.tables.grid import grids

        return _written(grids(frame, ties), style, footnotes), ()
    raise _unknown(style)


def _by_collection(
    frame: pd.DataFrame, ties: Ties, footnotes: Sequence[str], style: str, width: int, terminal: bool
) -> tuple[str, tuple[str, ...]]:
    from bench.reporting.tables import collections

    if style == "csv":
        return collections.collection_table(frame, ties).to_csv(index=False), tuple(footnotes)
    if style == "console":
        return collections.render_collections(frame, ties, footnotes, width=width, terminal=terminal), ()
    if style in ("markdown", "latex"):
        return _written(collections.collection_grids(frame, ties), style, footnotes), ()
    raise _unknown(style)


def _unknown(style: str) -> InputError:
    return InputError(f"there is no table format '{style}'{suggestion(style, FORMATS)}")


def text_of(
    grids: "Sequence[Grid]", frame: pd.DataFrame, style: str, *, width: int = 100, terminal: bool = False
) -> tuple[str, tuple[str, ...]]:
    """Other tables in a format, with the frame behind them for ``csv``; and the notes that are not in it (then all)."""
    if style == "csv":
        return frame.to_csv(index=False), tuple(note for grid in grids for note in grid.notes)
    if style == "console":
        from bench.reporting.tables.console import render_grid

        return "\n".join(render_grid(grid, width=width, terminal=terminal) for grid in grids), ()
    return _written(grids, style), ()


def _written(tables: "Sequence[Grid]", style: str, footnotes: Sequence[str] = ()) -> str:
    from bench.reporting.tables.grid import markdown
    from bench.reporting.tables.latex import latex

    return (markdown if style == "markdown" else latex)(tables, footnotes)
