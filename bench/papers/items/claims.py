"""Sentences of a paper as comparisons that can be tested, for several forms of its method."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bench.core import outcome
from bench.core.errors import InputError, shown, suggestion
from bench.papers.computed import Computed, extended, label, spelled
from bench.papers.published import SCENE, methods_of
from bench.plugins import selection
from bench.scoring.inference.difference import LEVEL, Difference, holm, paired, unpaired
from bench.scoring.metrics.oracle import ORACLE
from bench.suite.experiment import Suite

if TYPE_CHECKING:
    import pandas as pd

HONEST = "honest"
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


@dataclass(frozen=True)
class Claims:
    """Layout of such a table.

    Parameters
    ----------
    title
        What it is.
    forms
        Name of each form of the paper's method, and its selection.
    statements
        The sentences.
    alignment
        The rule that removes the gauge.
    published
        File of the published numbers; the paper's name of a scene is ours with spaces.
    seeds, timeout_s, memory_gib
        As in a suite.
    """

    title: str
    forms: Mapping[str, str]
    statements: tuple[Statement, ...]
    alignment: str
    published: str
    seeds: int = 10
    timeout_s: float = 3600.0
    memory_gib: float = 8.0

    def __post_init__(self) -> None:
        """Check the names of the forms."""
        for form in (form for statement in self.statements for form in statement.forms):
            if form not in self.forms:
                raise ValueError(f"unknown form {shown(form)}{suggestion(form, self.forms)}")

    def suites(self, name: str) -> tuple[Suite, ...]:
        """What has to run: a suite for each dataset and number of seeds."""
        methods: dict[tuple[str, int], dict[str, None]] = {}
        for statement in self.statements:
            for form, left, right, dataset in _comparisons(statement):
                for side in (left, right):
                    if not side.published:
                        place = extended(dataset, side.dataset), statement.seeds or self.seeds
                        chosen = methods.setdefault(place, {})
                        chosen[self._method(form, side)] = None
        return tuple(
            Suite(name, self.title, (dataset,), tuple(chosen), seeds, self.timeout_s, self.memory_gib)
            for (dataset, seeds), chosen in methods.items()
        )

    def compare(self, published: list[dict[str, str]], computed: Computed) -> "pd.DataFrame":
        """Test every comparison, one row for each and for each rule that picks the iterate.

        Under the rule "honest" the estimate counts, under "oracle" its checkpoint with the smallest mean error; a
        method without checkpoints and a published number are the same under both. Comparisons on the same problems are
        paired by problem and seed (for published numbers: by scene), others are not. Of the p values those under one
        rule are corrected for their number.

        Returns
        -------
        DataFrame
            ``sentence, form, dataset, left, right, rule, pairs`` (0 where unpaired), ``left_deg, right_deg,
            difference_deg, low_deg, high_deg, margin_deg, p_holds, p_fails, verdict``.

        Raises
        ------
        InputError
            Where a published column is not there.
        """
        import pandas as pd

        columns = methods_of(published)
        rows = []
        for statement in self.statements:
            for side in (*statement.left, *statement.right):
                if side.published and side.published not in columns:
                    raise InputError(
                        f"{self.published} has no column '{side.published}'{suggestion(side.published, columns)}"
                    )
            for form, left, right, dataset in _comparisons(statement):
                for rule in (HONEST, ORACLE):
                    a, b = (self._errors(statement, form, s, dataset, rule, published, computed) for s in (left, right))
                    names = (self._name(form, left), self._name(form, right))
                    rows.append(_row(statement, form, names, (left, right), dataset, rule, a, b))
        frame = pd.DataFrame(rows)
        for _, of_rule in frame.groupby("rule"):
            for column in ("p_holds", "p_fails"):
                frame.loc[of_rule.index, column] = holm(of_rule[column].tolist())
        frame["verdict"] = np.select([frame["p_holds"] < LEVEL, frame["p_fails"] < LEVEL], [HOLDS, FAILS], default=OPEN)
        return frame

    def _method(self, form: str, side: Side) -> str:
        return side.method or extended(self.forms[form], side.parameters)

    def _name(self, form: str, side: Side) -> str:
        return f"{side.published} (published)" if side.published else label("method", self._method(form, side))

    def _errors(
        self,
        statement: Statement,
        form: str,
        side: Side,
        dataset: str,
        rule: str,
        published: list[dict[str, str]],
        computed: Computed,
    ) -> Errors:
        if side.published:
            printed = {row[SCENE].replace(" ", "_"): row[side.published] for row in published}
            return {(instance, 0): float(text) for instance, text in printed.items() if text}
        if computed.results is None:
            return {}
        place, method = label("dataset", extended(dataset, side.dataset)), label("method", self._method(form, side))
        jobs = {job.id for job in computed.jobs if (job.dataset, spelled(job)) == (place, method)}
        frame = computed.results.frame
        own = frame[frame["job"].isin(jobs) & (frame["status"] == outcome.OK)]
        by_oracle = own["stop_reason"] == ORACLE
        chosen = own[by_oracle] if rule == ORACLE and by_oracle.any() else own[~by_oracle]
        values = zip(chosen["instance"], chosen["seed"], chosen[statement.statistic], strict=True)
        return {(instance, int(seed)): float(value) for instance, seed, value in values if np.isfinite(value)}


def _comparisons(statement: Statement) -> Iterator[tuple[str, Side, Side, str]]:
    """Form, left side, right side and dataset of each comparison."""
    for form, dataset in itertools.product(statement.forms, statement.datasets):
        for left, right in itertools.product(statement.left, statement.right):
            yield form, left, right, dataset


def _row(
    statement: Statement,
    form: str,
    names: tuple[str, str],
    sides: tuple[Side, Side],
    dataset: str,
    rule: str,
    left: Errors,
    right: Errors,
) -> dict[str, Any]:
    same_problems = sides[0].dataset == sides[1].dataset
    if same_problems:
        common = sorted(left.keys() & right.keys())
        a, b = (np.array([side[key] for key in common]) for side in (left, right))
        found = paired(a, b, statement.margin_deg)
    else:
        common = []
        a, b = (np.array(list(side.values())) for side in (left, right))
        found = unpaired(a, b, statement.margin_deg)
    return {
        "sentence": statement.sentence,
        "form": form,
        "dataset": dataset,
        "left": _placed(names[0], sides[0]),
        "right": _placed(names[1], sides[1]),
        "rule": rule,
        "statistic": statement.statistic,
        "pairs": len(common),
        "left_deg": float(a.mean()) if len(a) else np.nan,
        "right_deg": float(b.mean()) if len(b) else np.nan,
        **_columns(found),
        "margin_deg": statement.margin_deg,
    }


def _columns(found: Difference) -> dict[str, float]:
    return {
        "difference_deg": found.mean,
        "low_deg": found.low,
        "high_deg": found.high,
        "p_holds": found.p_below,
        "p_fails": found.p_above,
    }


def _placed(name: str, side: Side) -> str:
    return f"{name}, {selection.format_parameters(dict(side.dataset))}" if side.dataset else name
