"""The comparison of two runs as text."""

from collections.abc import Iterable, Iterator

import pandas as pd

from bench.core.words import counted
from bench.reporting import appearance
from bench.reporting.tables.grid import ABSENT, Cell, Grid
from bench.reporting.tables.printed import degrees, exact_seconds, p_value
from bench.scoring.comparison import Change, Comparison
from bench.scoring.paired import IDENTICAL, TIME

WORDS = {"all": "all methods", "method": "over all scenes"}
HEADS = ("first", "second", "ratio", "95 % interval", "p", "verdict")


def comparison_grid(found: Comparison, alignment: str, threshold: float) -> Grid:
    """All methods, each method, and the scenes on which the runs can be told apart; worse is bold.

    Parameters
    ----------
    found
        The comparison.
    alignment, threshold
        What its errors and verdicts go by.
    """
    rows = found.rows
    told = rows["verdict"].isin(["better", "worse"])
    shown = rows[told | ((rows["level"] != "scene") & (rows["verdict"] != IDENTICAL))]
    several = rows.loc[rows["level"] == "scene", "instance"].nunique() > 1
    return Grid(
        caption=f"{counted(found.cells, 'job')} compared; errors in degrees, {alignment} alignment",
        facts=("Method", "on", "of"),
        methods=tuple((head, "") for head in HEADS),
        rows=tuple(_row(row) for row in shown.itertuples() if several or row.level != "all"),
        notes=(*_legend(found, threshold), *(f"{_capital(note)}." for note in found.notes)),
    )


def verdict(found: Comparison) -> str:
    """The last line: what has become of it all."""
    if found.identical:
        return "identical"
    worse = _changes(outcome for outcome in found.outcomes if outcome.worse)
    rows = found.rows[found.rows["verdict"] == "worse"]
    if not worse and rows.empty:
        return "nothing is worse"
    methods = dict.fromkeys(_label(row) for row in rows.itertuples() if row.level != "all")
    return "; ".join(["worse: " + (", ".join(methods) or "all methods together")] * (not rows.empty) + worse)


def _row(row: "object") -> tuple[tuple[str, ...], tuple[Cell, ...]]:
    level, instance, quantity, word = (str(getattr(row, name)) for name in ("level", "instance", "quantity", "verdict"))
    old, new, ratio, low, high, p = (float(getattr(row, n)) for n in ("old", "new", "ratio", "low", "high", "p_holm"))
    value = exact_seconds if quantity == TIME else degrees
    known = low == low
    cells = (
        value(old),
        value(new),
        f"{ratio:.3f}",
        f"{low:.3f} to {high:.3f}" if known else ABSENT,
        p_value(p),
    )
    facts = (_label(row), instance if level == "scene" else WORDS[level], quantity)
    return facts, (*map(Cell, cells), Cell(word, word == "worse"))


def _label(row: "object") -> str:
    return appearance.current().called(str(row.method), str(row.params))  # type: ignore[attr-defined]


def _legend(found: Comparison, threshold: float) -> Iterator[str]:
    yield (
        "Ratio: second run to first, geometric mean over problems, above 1 is worse; p after Holm's correction. Better "
        f"or worse: p < 0.05 and a ratio beyond {threshold:g}. Single scenes are listed where runs can be told apart."
    )
    same = found.rows[(found.rows["level"] == "method") & (found.rows["verdict"] == IDENTICAL)]
    if len(same):
        yield f"Identical: {', '.join(dict.fromkeys(_label(row) for row in same.itertuples()))}."
    yield from (f"{change}." for change in _changes(found.outcomes))


def _changes(outcomes: Iterable[Change]) -> list[str]:
    """A sentence for each change of a method, however many jobs it is about."""
    alike: dict[tuple[str, ...], list[Change]] = {}
    for outcome in outcomes:
        alike.setdefault((*outcome.cell[3:5], outcome.old, outcome.new), []).append(outcome)
    return [
        f"{first} (and so for {counted(len(others), 'other job')})" if others else f"{first}"
        for first, *others in alike.values()
    ]


def _capital(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}"


def comparison_table(found: Comparison) -> pd.DataFrame:
    """Every row unrounded, with a row for each changed outcome."""
    rows = [
        {
            "level": "outcome",
            **dict(zip(("dataset", "instance", "protocol", "method", "params"), outcome.cell, strict=False)),
            "quantity": f"seed {outcome.cell[-1]}",
            "verdict": f"{outcome.old} -> {outcome.new}",
        }
        for outcome in found.outcomes
    ]
    return pd.concat([found.rows, pd.DataFrame(rows)], ignore_index=True) if rows else found.rows
