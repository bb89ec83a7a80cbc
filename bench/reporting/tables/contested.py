"""The comparison of one method with others of its run as text."""

from collections.abc import Iterator
from typing import Any

import pandas as pd

from bench.core.words import counted
from bench.reporting import appearance
from bench.reporting.tables.grid import ABSENT, Cell, Grid
from bench.reporting.tables.printed import degrees, exact_seconds, p_value
from bench.scoring.contest import OVERALL, SCENE, TIE, Contest
from bench.scoring.paired import TIME

RATIO = "ratio"
INTERVAL = "95 % interval"
HEADS = (RATIO, INTERVAL, "p", "verdict")
TALLY = "win / tie / loss"


def contest_grids(found: Contest, alignment: str, threshold: float) -> list[Grid]:
    """A table over all scenes and, where there are several, one with a row for each of them.

    Parameters
    ----------
    found
        The comparison.
    alignment, threshold
        What its errors and verdicts go by.
    """
    name = appearance.current().called(*found.method)
    several = found.scenes > 1
    against = f"{name} against {counted(len(found.others), 'other method')}"
    rules = f"errors in degrees, {alignment} alignment"
    whole = Grid(
        caption=f"{against} over {counted(found.scenes, 'scene')}; {rules}",
        facts=("Against", "of"),
        methods=tuple((head, "") for head in (name, "other", *HEADS, *([TALLY] if several else []))),
        rows=tuple(_overall(row, several) for row in _rows(found, OVERALL)),
        notes=(_legend(name, threshold, several), *(f"{note[0].upper()}{note[1:]}." for note in found.notes)),
    )
    if not several:
        return [whole]
    scenes = Grid(
        caption=f"{against}, scene by scene; {rules}",
        facts=("Scene", "against", "of"),
        methods=tuple((head, "") for head in (name, "other", *HEADS)),
        rows=tuple(_scene(row) for row in _rows(found, SCENE)),
        notes=(),
    )
    return [whole, scenes]


def _rows(found: Contest, level: str) -> Iterator["pd.Series[Any]"]:
    for _, row in found.rows[found.rows["level"] == level].iterrows():
        yield row


def _overall(row: "pd.Series[Any]", several: bool) -> tuple[tuple[str, ...], tuple[Cell, ...]]:
    tally = [Cell(f"{row['wins']:.0f} / {row['ties']:.0f} / {row['losses']:.0f}")] if several else []
    return (_against(row), str(row["quantity"])), (*_cells(row), *tally)


def _scene(row: "pd.Series[Any]") -> tuple[tuple[str, ...], tuple[Cell, ...]]:
    return (str(row["instance"]), _against(row), str(row["quantity"])), _cells(row)


def _against(row: "pd.Series[Any]") -> str:
    return appearance.current().called(str(row["method"]), str(row["params"]))


def _cells(row: "pd.Series[Any]") -> tuple[Cell, ...]:
    value = exact_seconds if row["quantity"] == TIME else degrees
    ratio, low, high = (float(row[name]) for name in ("ratio", "low", "high"))
    verdict, why = str(row["verdict"]), str(row["why"])
    return (
        Cell(value(float(row["own"]))),
        Cell(value(float(row["other"]))),
        Cell(f"{ratio:.3f}" if ratio == ratio else ABSENT),
        Cell(f"{low:.3f} to {high:.3f}" if low == low else ABSENT),
        Cell(p_value(float(row["p_holm"]))),
        Cell(f"{verdict} ({why})" if why else verdict, verdict != TIE),
    )


def _legend(name: str, threshold: float, several: bool) -> str:
    tally = (
        "; over all scenes geometric means. A method that failed on a scene, or scored fewer than 95 % as many cameras "
        "as the other, loses there and does not win over all"
        if several
        else ""
    )
    return (
        f"Ratio: {name} to the other, below 1 {name} is better{tally}. Bold: a win or loss, p < 0.05 after Holm's "
        f"correction and a ratio beyond {threshold:g}; what cannot be told apart is a tie."
    )
