"""A published table of errors, a row for each scene and a column for each method, beside our own."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bench.core import outcome
from bench.core.errors import InputError, suggestion
from bench.papers.computed import Computed, extended, one
from bench.papers.published import FACTS, SCENE, methods_of
from bench.plugins import selection
from bench.suite.experiment import Suite

if TYPE_CHECKING:
    import pandas as pd

ROUNDING = 1e-9  # 4.4 - 3.9 is not above 0.5

NOT_ON_DISK = "not on disk"
NO_TRUTH = "no ground truth"
PUBLISHED_ONLY = "published only"

Statistic = Literal["mean_deg", "median_deg"]
Row = dict[str, Any]


@dataclass(frozen=True)
class SceneTable:
    """Layout of such a table.

    Parameters
    ----------
    title
        What the table is, in the paper's words.
    published
        File of its numbers; see `bench.papers.published`.
    dataset, scene_parameter
        Selection of the dataset, protocol included, and its parameter that takes a scene.
    statistic, alignment
        What is printed of the errors, and the rule that removes the gauge.
    highlight_reference, highlight_deg
        Numbers at most that far from those of the reference column are highlighted.
    measured
        For each published column the selections that are measured for it; none for what is published only. The
        reference column's first is the reference among what is measured.
    scenes
        The paper's name of each scene, and ours.
    variants
        For each published column further selections that could stand for it; `bench.papers.explain` tries them.
    seeds, timeout_s, memory_gib
        As in a suite.
    """

    title: str
    published: str
    dataset: str
    scene_parameter: str
    statistic: Statistic
    alignment: str
    highlight_reference: str
    highlight_deg: float
    measured: Mapping[str, tuple[str, ...]]
    scenes: Mapping[str, str]
    variants: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    seeds: int = 1
    timeout_s: float = 600.0
    memory_gib: float = 8.0

    def suites(self, name: str) -> tuple[Suite, ...]:
        """What has to run."""
        datasets = tuple(extended(self.dataset, {self.scene_parameter: scene}) for scene in self.scenes.values())
        methods = tuple(dict.fromkeys(text for texts in self.measured.values() for text in texts))
        return (Suite(name, self.title, datasets, methods, self.seeds, self.timeout_s, self.memory_gib),)

    def compare(self, published: list[dict[str, str]], computed: Computed) -> "pd.DataFrame":
        """Measured, published and difference, one row for each cell of the table.

        Returns
        -------
        DataFrame
            ``scene, instance, quantity, method, measured, published, difference, near_measured, near_published,
            status``. A quantity is one of `bench.papers.published.FACTS` or a published column; a column for which
            several methods are measured has a row for each. `published` is text, as printed; `near_…` tells
            what the paper's rule highlights, among measured and among published numbers; `status` is "ok", how
            the job ended, or why nothing was measured.

        Raises
        ------
        InputError
            Where the layout and the published file do not fit together.
        """
        import pandas as pd

        columns = methods_of(published)
        self.check(published)
        return pd.DataFrame([row for scene in published for row in self._scene(scene, columns, computed)])

    def check(self, published: list[dict[str, str]]) -> None:
        """Raise InputError where the layout and the published file do not fit together."""
        columns = methods_of(published)
        for column in (*columns, self.highlight_reference):
            if column not in self.measured:
                raise InputError(f"{self.published}: the layout's 'measured' has no entry for column '{column}'")
        for column in (*self.measured, *self.variants):
            if column not in columns:
                raise InputError(f"{self.published} has no column '{column}'{suggestion(column, columns)}")
        for row in published:
            if row[SCENE] not in self.scenes:
                raise InputError(f"{self.published}: the layout's 'scenes' has no entry for '{row[SCENE]}'")

    def _scene(
        self, printed: Mapping[str, str], columns: Sequence[str], computed: Computed
    ) -> Iterator[dict[str, Any]]:
        found = _rows_of(computed, self.scenes[printed[SCENE]])
        start = {"scene": printed[SCENE], "instance": self.scenes[printed[SCENE]]}
        for fact in FACTS:
            measured = np.nan if found is None else float(found[fact].iloc[0])
            yield start | _cell(fact, "", measured, printed[fact], NOT_ON_DISK if found is None else outcome.OK)
        first = next(iter(self.measured[self.highlight_reference]), "")
        reference, reference_printed = self._score(found, first)[0], _number(printed[self.highlight_reference])
        for column in columns:
            for method in self.measured[column] or ("",):
                measured, status = self._score(found, method)
                cell = _cell(column, method, measured, printed[column], status)
                if column != self.highlight_reference:
                    cell["near_measured"] = self._near(measured, reference)
                    cell["near_published"] = self._near(_number(printed[column]), reference_printed)
                yield start | cell

    def _score(self, rows: "pd.DataFrame | None", method: str) -> tuple[float, str]:
        """Mean over the seeds that ended well, and a status."""
        if not method:
            return np.nan, PUBLISHED_ONLY
        if rows is None:
            return np.nan, NOT_ON_DISK
        name, parameters = one("method", method)
        own = rows[(rows["method"] == name) & (rows["params"] == selection.format_parameters(parameters))]
        well = own[own["status"] == outcome.OK]
        if well.empty:
            return np.nan, "; ".join(dict.fromkeys(own["status"])) or outcome.NOT_RUN
        value = float(well[self.statistic].mean())
        return value, outcome.OK if np.isfinite(value) else NO_TRUTH

    def _near(self, value: float, reference: float) -> bool:
        return bool(abs(value - reference) <= self.highlight_deg + ROUNDING)


def _rows_of(computed: Computed, instance: str) -> "pd.DataFrame | None":
    if computed.results is None:
        return None
    frame = computed.results.frame
    rows = frame[frame["instance"] == instance]
    return None if rows.empty else rows


def _cell(quantity: str, method: str, measured: float, published: str, status: str) -> Row:
    return {
        "quantity": quantity,
        "method": method,
        "measured": measured,
        "published": published,
        "difference": measured - _number(published),
        "near_measured": False,
        "near_published": False,
        "status": status,
    }


def _number(printed: str) -> float:
    return float(printed) if printed else np.nan
