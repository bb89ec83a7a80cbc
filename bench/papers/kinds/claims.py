"""Sentences of a paper as comparisons that can be tested, for several forms of its method."""

import itertools
import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import numpy as np

from bench.core.errors import InputError, shown, suggestion
from bench.papers.computed import Computed, extended, label
from bench.papers.item import Comparison, MeasuredItem
from bench.papers.published import SCENE, Sources, methods_of, read_published
from bench.papers.recorded import read_rows, recorded_note
from bench.plugins import selection
from bench.scoring.inference.difference import LEVEL, holm, paired, unpaired
from bench.scoring.metrics.oracle import ORACLE
from bench.suite.experiment import Suite

if TYPE_CHECKING:
    from bench.reporting.tables.grid import Grid

HONEST = "honest"
RULES = (HONEST, ORACLE)
HOLDS, FAILS, OPEN = "holds", "does not hold", "cannot tell"

Errors = dict[tuple[str, int], float]  # by instance and seed


@dataclass(frozen=True)
class Side:
    """One side of a comparison: the paper's method with `parameters`, another `method`, or a `published` column.

    Parameters
    ----------
    parameters
        Added to the form of the paper's method.
    method
        A selection, in place of the paper's method.
    published
        A column of the published table, in place of a measured method.
    dataset
        Parameters added to the comparison's dataset.
    """

    parameters: Mapping[str, Any] = field(default_factory=dict)
    method: str = ""
    published: str = ""
    dataset: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Statement:
    """A sentence: on every dataset, every left side's mean error is below every right side's plus a margin.

    Parameters
    ----------
    sentence
        What the paper says, in short.
    statistic
        What is compared of the errors.
    margin_deg
        Degrees by which the left side may be worse.
    seeds
        How many; 0 for as many as the table has.
    datasets
        Selections.
    left, right
        The two sides.
    forms
        Names of the forms of the paper's method that are asked.
    """

    sentence: str
    statistic: Literal["mean_deg", "median_deg"]
    datasets: tuple[str, ...]
    left: tuple[Side, ...]
    right: tuple[Side, ...]
    forms: tuple[str, ...]
    margin_deg: float = 0.0
    seeds: int = 0


@dataclass(frozen=True, kw_only=True)
class Claims(MeasuredItem):
    """Layout of such a table.

    Parameters
    ----------
    forms
        Name of each form of the paper's method, and its selection.
    statements
        The sentences.
    published
        File of the published numbers; the paper's name of a scene is ours with spaces.
    recorded, recorded_took
        File in ``results/reference`` with the comparisons as they were computed once, and how long that took, in words.
    """

    forms: Mapping[str, str]
    statements: tuple[Statement, ...]
    published: str
    recorded: str = ""
    recorded_took: str = ""
    seeds: int = 10
    timeout_s: float = 3600.0

    needs: ClassVar[Collection[str]] = (ORACLE,)

    def __post_init__(self) -> None:
        """Check the names of the forms."""
        for form in (form for statement in self.statements for form in statement.forms):
            if form not in self.forms:
                raise ValueError(f"unknown form {shown(form)}{suggestion(form, self.forms)}")

    def suites(self, name: str) -> tuple[Suite, ...]:
        """What has to run: a suite for each dataset and number of seeds."""
        methods: dict[tuple[str, int], dict[str, None]] = {}
        for case in self._cases():
            for side in (side for side in (case.left, case.right) if not side.published):
                place = extended(case.dataset, side.dataset), case.statement.seeds or self.seeds
                methods.setdefault(place, {})[self._method(case.form, side)] = None
        return tuple(self.suite(name, [dataset], chosen, seeds) for (dataset, seeds), chosen in methods.items())

    def verify(self, sources: Sources) -> None:
        """Check that every published column is there."""
        printed = self._all_printed(sources)
        for case in self._cases():
            for side in (side for side in (case.left, case.right) if side.published):
                self._printed(side, printed)

    def read_recorded(self, sources: Sources) -> "Verdicts | None":
        """The comparisons on file; None where the layout names no file."""
        if not self.recorded:
            return None
        rows = read_rows(Verdict, sources.reference, self.recorded)
        return Verdicts(self, rows, Computed(self.alignment, recorded=recorded_note(self.recorded, self.recorded_took)))

    def compare(self, sources: Sources, computed: Computed) -> "Verdicts":
        """Test every comparison under each rule that picks the iterate.

        Under the rule "honest" the estimate counts, under "oracle" its checkpoint with the smallest mean error; a
        method without checkpoints and a published number are the same under both. Comparisons on the same problems are
        paired by problem and seed (for published numbers: by scene), others are not. Of the p values those under one
        rule are corrected for their number.

        Raises
        ------
        InputError
            Where a published column is not there.
        """
        printed = self._all_printed(sources)
        rows = []
        for case, rule in itertools.product(self._cases(), RULES):
            left, right = (
                self._printed(side, printed) if side.published else self._errors(case, side, rule, computed)
                for side in (case.left, case.right)
            )
            rows.append(self._tested(case, rule, left, right))
        return Verdicts(self, tuple(_judged(rows)), computed)

    def _cases(self) -> Iterator["_Case"]:
        for of in self.statements:
            for form, dataset, left, right in itertools.product(of.forms, of.datasets, of.left, of.right):
                yield _Case(of, form, dataset, left, right)

    def _method(self, form: str, side: Side) -> str:
        return side.method or extended(self.forms[form], side.parameters)

    def _name(self, form: str, side: Side) -> str:
        name = f"{side.published} (published)" if side.published else label("method", self._method(form, side))
        return f"{name}, {selection.format_parameters(side.dataset)}" if side.dataset else name

    def _all_printed(self, sources: Sources) -> dict[str, Errors]:
        """The published errors by column."""
        published = read_published(sources.published, self.published)
        return {
            column: {(row[SCENE].replace(" ", "_"), 0): float(row[column]) for row in published if row[column]}
            for column in methods_of(published)
        }

    def _printed(self, side: Side, printed: Mapping[str, Errors]) -> Errors:
        if side.published not in printed:
            guess = suggestion(side.published, printed)
            raise InputError(f"{self.published} has no column '{side.published}'{guess}")
        return printed[side.published]

    def _errors(self, case: "_Case", side: Side, rule: str, computed: Computed) -> Errors:
        place = label("dataset", extended(case.dataset, side.dataset)), label("method", self._method(case.form, side))
        own = [score for score in computed.scores if score.ok and (score.dataset, score.method) == place]
        by_oracle = [score for score in own if score.oracle]
        chosen = by_oracle if rule == ORACLE and by_oracle else [score for score in own if not score.oracle]
        values = {(s.instance, s.seed): float(getattr(s, case.statement.statistic)) for s in chosen}
        return {key: value for key, value in values.items() if np.isfinite(value)}

    def _tested(self, case: "_Case", rule: str, left: Errors, right: Errors) -> "Verdict":
        paired_by = sorted(left.keys() & right.keys()) if case.left.dataset == case.right.dataset else None
        a, b = (np.array([side[key] for key in (side if paired_by is None else paired_by)]) for side in (left, right))
        statement = case.statement
        found = (unpaired if paired_by is None else paired)(a, b, statement.margin_deg)
        return Verdict(
            statement.sentence,
            case.form,
            case.dataset,
            self._name(case.form, case.left),
            self._name(case.form, case.right),
            rule,
            statement.statistic,
            len(paired_by or ()),
            float(a.mean()) if len(a) else np.nan,
            float(b.mean()) if len(b) else np.nan,
            found.mean,
            found.low,
            found.high,
            found.p_below,
            found.p_above,
            statement.margin_deg,
        )


class _Case(NamedTuple):
    """One comparison of a statement."""

    statement: Statement
    form: str
    dataset: str
    left: Side
    right: Side


@dataclass(frozen=True)
class Verdict:
    """One comparison under one rule; `pairs` is 0 where the two sides are not paired."""

    sentence: str
    form: str
    dataset: str
    left: str
    right: str
    rule: str
    statistic: str
    pairs: int
    left_deg: float
    right_deg: float
    difference_deg: float
    low_deg: float
    high_deg: float
    p_holds: float
    p_fails: float
    margin_deg: float
    verdict: str = ""


@dataclass(frozen=True)
class Verdicts(Comparison):
    """Every comparison, tested."""

    table: Claims
    rows: tuple[Verdict, ...]
    computed: Computed

    def grid(self) -> "Grid":
        """A row for each comparison: both sides and the verdict, under the honest rule and under the oracle."""
        from bench.reporting.tables.grid import ABSENT, Cell, Grid
        from bench.reporting.tables.printed import degrees

        def cells(row: Verdict) -> Iterator[Cell]:
            for side in (row.left_deg, row.right_deg):
                yield Cell(degrees(side) if math.isfinite(side) else ABSENT)
            half = (row.high_deg - row.low_deg) / 2
            yield Cell(f"{row.difference_deg:+.2f} ±{half:.2f}" if math.isfinite(half) else ABSENT)
            yield Cell(row.verdict, row.verdict == HOLDS)

        when = " (recorded)" if self.computed.recorded else ""
        comparisons: dict[tuple[str, ...], dict[str, Verdict]] = {}
        for row in self.rows:
            key = row.sentence, row.form, row.dataset, row.left, row.right
            comparisons.setdefault(key, {})[row.rule] = row
        rows = []
        said = ""
        for (sentence, form, dataset, left, right), by_rule in comparisons.items():
            where = dataset.split("[", 1)[1].rstrip("]") if "[" in dataset else dataset
            facts = ("" if sentence == said else sentence, form, where, f"{left} < {right}")
            rows.append((facts, tuple(cell for rule in RULES for cell in cells(by_rule[rule]))))
            said = sentence
        return Grid(
            caption=f"{self.table.title}{when}; degrees, {self.computed.alignment} alignment",
            facts=("The paper says", "form", "on", "tested"),
            methods=tuple((what, rule) for rule in RULES for what in ("left", "right", "difference", "verdict")),
            rows=tuple(rows),
            notes=tuple(self._notes()),
        )

    def _notes(self) -> Iterator[str]:
        yield (
            "Left below right, by Student's t on differences paired by problem, or Welch's where the problems differ; "
            f"p < 0.05 after Holm's correction for all comparisons of a rule. {OPEN}: neither this nor its opposite "
            "shown."
        )
        for sentence, margin in {s.sentence: s.margin_deg for s in self.table.statements if s.margin_deg}.items():
            yield f"“{sentence}”: left below right plus {margin:g} degrees."
        yield (
            f"{HONEST}: what the method returns, which has seen no ground truth. {ORACLE}: the checkpoint that ground "
            "truth likes best, which is how the published figures were picked."
        )
        counts: dict[tuple[str, str, str], Counter[str]] = {}
        for row in sorted(self.rows, key=lambda row: RULES.index(row.rule)):
            counts.setdefault((row.rule, row.sentence, row.form), Counter())[row.verdict] += 1
        for (rule, sentence, form), verdicts in counts.items():
            told = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.most_common())
            yield f"{rule}, {form}: “{sentence}”: {told} (of {verdicts.total()})."
        yield from self.computed.remarks()


def _judged(rows: Sequence[Verdict]) -> Iterator[Verdict]:
    """The comparisons with the p values under each rule corrected for their number, and what follows from them."""
    corrected: dict[int, tuple[float, float]] = {}
    for rule in RULES:
        own = [k for k, row in enumerate(rows) if row.rule == rule]
        below, above = holm([rows[k].p_holds for k in own]), holm([rows[k].p_fails for k in own])
        corrected |= {k: (float(p), float(q)) for k, p, q in zip(own, below, above, strict=True)}
    for k, row in enumerate(rows):
        holds, fails = corrected[k]
        verdict = HOLDS if holds < LEVEL else FAILS if fails < LEVEL else OPEN
        yield replace(row, p_holds=holds, p_fails=fails, verdict=verdict)


ITEM = Claims
