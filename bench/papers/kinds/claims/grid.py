"""What became of a paper's sentences, as a table."""

import math
from collections import Counter
from collections.abc import Iterator

from bench.papers.kinds.claims.statements import HOLDS, HONEST, OPEN, RULES, Verdict, Verdicts
from bench.reporting.tables.grid import ABSENT, Cell, Grid
from bench.reporting.tables.rows import degrees
from bench.scoring.metrics.oracle import ORACLE


def claims_grid(found: Verdicts) -> Grid:
    """A row for each comparison: both sides and the verdict, under the honest rule and under the oracle."""
    comparisons: dict[tuple[str, ...], dict[str, Verdict]] = {}
    for row in found.rows:
        key = row.sentence, row.form, row.dataset, row.left, row.right
        comparisons.setdefault(key, {})[row.rule] = row
    rows = []
    said = ""
    for (sentence, form, dataset, left, right), by_rule in comparisons.items():
        facts = ("" if sentence == said else sentence, form, _short(dataset), f"{left} < {right}")
        rows.append((facts, tuple(cell for rule in RULES for cell in _cells(by_rule[rule]))))
        said = sentence
    return Grid(
        caption=f"{found.table.title}; degrees, {found.computed.alignment} alignment",
        facts=("The paper says", "form", "on", "tested"),
        methods=tuple((what, rule) for rule in RULES for what in ("left", "right", "difference", "verdict")),
        rows=tuple(rows),
        notes=tuple(_notes(found)),
    )


def _cells(row: Verdict) -> Iterator[Cell]:
    for side in (row.left_deg, row.right_deg):
        yield Cell(degrees(side) if math.isfinite(side) else ABSENT)
    half = (row.high_deg - row.low_deg) / 2
    yield Cell(f"{row.difference_deg:+.2f} ±{half:.2f}" if math.isfinite(half) else ABSENT)
    yield Cell(row.verdict, row.verdict == HOLDS)


def _short(dataset: str) -> str:
    return dataset.split("[", 1)[1].rstrip("]") if "[" in dataset else dataset


def _notes(found: Verdicts) -> Iterator[str]:
    yield (
        "Left below right, by Student's t on differences paired by problem, or Welch's where the problems differ; "
        f"p < 0.05 after Holm's correction for all comparisons of a rule. {OPEN}: neither this nor its opposite shown."
    )
    for sentence, margin in {s.sentence: s.margin_deg for s in found.table.statements if s.margin_deg}.items():
        yield f"“{sentence}”: left below right plus {margin:g} degrees."
    yield (
        f"{HONEST}: what the method returns, which has seen no ground truth. {ORACLE}: the checkpoint that ground "
        "truth likes best, which is how the published figures were picked."
    )
    counts: dict[tuple[str, str, str], Counter[str]] = {}
    for rule in RULES:
        for row in (row for row in found.rows if row.rule == rule):
            counts.setdefault((rule, row.sentence, row.form), Counter())[row.verdict] += 1
    for (rule, sentence, form), verdicts in counts.items():
        told = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.most_common())
        yield f"{rule}, {form}: “{sentence}”: {told} (of {verdicts.total()})."
    yield from found.computed.absences()
