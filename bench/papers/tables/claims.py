"""What became of a paper's sentences, and of the time of its recipe, as tables."""

import math
from collections.abc import Iterator

import pandas as pd

from bench.papers.computed import Computed
from bench.papers.items.claims import HOLDS, HONEST, OPEN, Claims
from bench.papers.items.speedup import Speedup
from bench.reporting.tables.grid import ABSENT, Cell, Grid
from bench.reporting.tables.rows import degrees
from bench.scoring.metrics.oracle import ORACLE


def claims_grid(table: Claims, frame: pd.DataFrame, computed: Computed, alignment: str) -> Grid:
    """A row for each comparison: both sides and the verdict, under the honest rule and under the oracle.

    Parameters
    ----------
    table, frame
        The layout, and what its `compare` gave.
    computed
        Where the notes on missing data are taken from.
    alignment
        The rule that removed the gauge.
    """
    rows = []
    said = ""
    keys = ["sentence", "form", "dataset", "left", "right"]
    for (sentence, form, dataset, left, right), of_rule in frame.groupby(keys, sort=False):
        by_rule = {row.rule: row for row in of_rule.itertuples()}
        facts = ("" if sentence == said else str(sentence), str(form), _short(str(dataset)), f"{left} < {right}")
        cells = [cell for rule in (HONEST, ORACLE) for cell in _cells(by_rule[rule])]
        rows.append((facts, tuple(cells)))
        said = str(sentence)
    heads = [(what, rule) for rule in (HONEST, ORACLE) for what in ("left", "right", "difference", "verdict")]
    return Grid(
        caption=f"{table.title}; degrees, {alignment} alignment",
        facts=("The paper says", "form", "on", "tested"),
        methods=tuple(heads),
        rows=tuple(rows),
        notes=tuple(_notes(table, frame, computed)),
    )


def _cells(row: "object") -> Iterator[Cell]:
    left, right, mean, low, high, verdict = (
        getattr(row, name) for name in ("left_deg", "right_deg", "difference_deg", "low_deg", "high_deg", "verdict")
    )
    yield Cell(degrees(left) if math.isfinite(left) else ABSENT)
    yield Cell(degrees(right) if math.isfinite(right) else ABSENT)
    yield Cell(f"{mean:+.2f} ±{(high - low) / 2:.2f}" if math.isfinite(high) else ABSENT)
    yield Cell(str(verdict), verdict == HOLDS)


def _short(dataset: str) -> str:
    return dataset.split("[", 1)[1].rstrip("]") if "[" in dataset else dataset


def _notes(table: Claims, frame: pd.DataFrame, computed: Computed) -> Iterator[str]:
    margins = {s.sentence: s.margin_deg for s in table.statements if s.margin_deg}
    yield (
        "Left below right, by Student's t on differences paired by problem, or Welch's where the problems differ; "
        f"p < 0.05 after Holm's correction for all comparisons of a rule. {OPEN}: neither this nor its opposite shown."
    )
    for sentence, margin in margins.items():
        yield f"“{sentence}”: left below right plus {margin:g} degrees."
    yield (
        f"{HONEST}: what the method returns, which has seen no ground truth. {ORACLE}: the checkpoint that ground "
        "truth likes best, which is how the published figures were picked."
    )
    for rule in (HONEST, ORACLE):
        of_rule = frame[frame["rule"] == rule]
        for sentence, rows in of_rule.groupby("sentence", sort=False):
            for form, own in rows.groupby("form", sort=False):
                counts = own["verdict"].value_counts()
                told = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
                yield f"{rule}, {form}: “{sentence}”: {told} (of {len(own)})."
    yield from (f"{sentence[0].upper()}{sentence[1:]}." for sentence in computed.missing)


def speedup_grid(table: Speedup, frame: pd.DataFrame, computed: Computed, alignment: str) -> Grid:
    """The method and the recipe, with the ratio of their times.

    Parameters
    ----------
    table, frame
        The layout, and what its `compare` gave.
    computed
        Where the notes on missing data are taken from.
    alignment
        The rule that removed the gauge.
    """
    rows = tuple(
        (
            (str(row.method),),
            tuple(
                map(
                    Cell,
                    (
                        f"{int(row.iterations)}",
                        f"{1e3 * row.iteration_s:.2f}",
                        f"{row.total_s:.3g}",
                        degrees(row.mean_deg),
                        degrees(row.median_deg),
                        f"{row.times_less:.3g}",
                    ),
                )
            ),
        )
        for row in frame.itertuples()
    )
    heads = ("iterations", "ms an iteration", "s in total", "mean", "median", "times less")
    notes = [
        f"The recipe's time is that of an iteration, measured here, times its {table.iterations:,} iterations.",
        f"The recipe's errors are its {ORACLE}'s (the iterate that ground truth likes best), from {table.curves}.",
    ]
    notes += [f"{sentence[0].upper()}{sentence[1:]}." for sentence in computed.missing]
    return Grid(
        caption=f"{table.title}; degrees, {alignment} alignment, {table.dataset}",
        facts=("Method",),
        methods=tuple((head, "") for head in heads),
        rows=rows,
        notes=tuple(notes),
    )
