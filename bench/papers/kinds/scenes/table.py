"""What a layout says of a table of scenes, and its cells: measured, published, difference."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from bench.core import outcome
from bench.core.errors import InputError, suggestion
from bench.papers.computed import Computed, Score, extended
from bench.papers.item import Comparison, MeasuredItem
from bench.papers.published import FACTS, SCENE, Sources, methods_of, read_published
from bench.suite.experiment import Suite

if TYPE_CHECKING:
    import pandas as pd

    from bench.reporting.tables.grid import Grid

ROUNDING = 1e-9  # 4.4 - 3.9 is not above 0.5

NOT_ON_DISK = "not on disk"
NO_TRUTH = "no ground truth"
PUBLISHED_ONLY = "published only"
NOT_IN_PAPER = "not in the paper"  # the column of what the paper does not have


@dataclass(frozen=True)
class SceneTable(MeasuredItem):
    """Layout of such a table.

    Parameters
    ----------
    published
        File of its numbers; see `bench.papers.published`.
    dataset, scene_parameter
        Selection of the dataset, protocol included, and its parameter that takes a scene.
    statistic
        What is printed of the errors.
    highlight_reference, highlight_deg
        Numbers at most that far from those of the reference column are highlighted.
    measured
        For each published column the selections that are measured for it; none for what is published only. The
        reference column's first is the reference among what is measured.
    scenes
        The paper's name of each scene, and ours.
    further
        Selections that the paper does not have, each a column of its own after the published ones.
    notes
        Sentences for below the table.
    variants
        For each published column further selections that could stand for it; `bench.papers.explain` tries them.
    """

    published: str
    dataset: str
    scene_parameter: str
    statistic: Literal["mean_deg", "median_deg"]
    highlight_reference: str
    highlight_deg: float
    measured: Mapping[str, tuple[str, ...]]
    scenes: Mapping[str, str]
    further: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    variants: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def suites(self, name: str) -> tuple[Suite, ...]:
        """What has to run."""
        datasets = (extended(self.dataset, {self.scene_parameter: scene}) for scene in self.scenes.values())
        return (self.suite(name, datasets, dict.fromkeys([*itertools.chain(*self.measured.values()), *self.further])),)

    def with_methods(self, methods: Sequence[str]) -> "SceneTable":
        """The table with a column for each of these; those that it has already keep their place."""
        return replace(self, further=tuple(dict.fromkeys((*self.further, *methods))))

    def verify(self, sources: Sources) -> None:
        """Check that the layout and the published file fit together; raises as `check`."""
        self.check(read_published(sources.published, self.published))

    def compare(self, sources: Sources, computed: Computed) -> "Scenes":
        """Measured, published and difference of each cell.

        Raises
        ------
        InputError
            Where the layout and the published file do not fit together.
        """
        published = read_published(sources.published, self.published)
        self.check(published)
        columns = methods_of(published)
        rows = tuple(row for scene in published for row in self._scene(scene, columns, computed))
        return Scenes(self, rows, computed)

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

    def _scene(self, printed: Mapping[str, str], columns: Sequence[str], computed: Computed) -> Iterator["Measured"]:
        scene, instance = printed[SCENE], self.scenes[printed[SCENE]]
        found = [score for score in computed.scores if score.instance == instance]
        for fact in FACTS:
            measured = float(getattr(found[0], fact)) if found else np.nan
            yield Measured(scene, instance, fact, "", measured, printed[fact], outcome.OK if found else NOT_ON_DISK)
        first = next(iter(self.measured[self.highlight_reference]), "")
        reference = self._score(found, computed.spelled(first) if first else "")[0]
        reference_printed = number(printed[self.highlight_reference])
        for column in columns:
            other = column != self.highlight_reference
            for method in self.measured[column] or ("",):
                measured, status = self._score(found, computed.spelled(method) if method else "")
                yield Measured(
                    scene,
                    instance,
                    column,
                    method,
                    measured,
                    printed[column],
                    status,
                    other and self._near(measured, reference),
                    other and self._near(number(printed[column]), reference_printed),
                )

        for text in self.further:
            method = computed.spelled(text)
            measured, status = self._score(found, method)
            near = self._near(measured, reference)
            yield Measured(scene, instance, NOT_IN_PAPER, method, measured, "", status, near)

    def _score(self, found: Sequence[Score], method: str) -> tuple[float, str]:
        """Mean over the seeds that ended well, and a status."""
        if not method:
            return np.nan, PUBLISHED_ONLY
        if not found:
            return np.nan, NOT_ON_DISK
        own = [score for score in found if score.method == method]
        well = [float(getattr(score, self.statistic)) for score in own if score.ok]
        if not well:
            return np.nan, "; ".join(dict.fromkeys(score.status for score in own)) or outcome.NOT_RUN
        value = float(np.nanmean(well)) if np.isfinite(well).any() else np.nan
        return value, outcome.OK if np.isfinite(value) else NO_TRUTH

    def _near(self, value: float, reference: float) -> bool:
        return bool(abs(value - reference) <= self.highlight_deg + ROUNDING)


@dataclass(frozen=True)
class Measured:
    """A cell of the table, or a fact of its scene.

    Parameters
    ----------
    scene, instance
        The paper's name of the scene, and ours.
    quantity, method
        One of `bench.papers.published.FACTS` or a published column, and what is measured for it.
    measured, published
        NaN where nothing was measured; as printed, "" where nothing was.
    status
        "ok", how the job ended, or why nothing was measured.
    near_measured, near_published
        What the paper's rule highlights, among measured and among published numbers.
    """

    scene: str
    instance: str
    quantity: str
    method: str
    measured: float
    published: str
    status: str
    near_measured: bool = False
    near_published: bool = False

    @property
    def difference(self) -> float:
        """Measured less published; NaN where one of the two is missing."""
        return self.measured - number(self.published)


@dataclass(frozen=True)
class Scenes(Comparison):
    """The table, filled."""

    table: SceneTable
    rows: tuple[Measured, ...]
    computed: Computed

    def frame(self) -> "pd.DataFrame":
        """A row for each `Measured`, with the ``difference``."""
        frame = super().frame()
        frame.insert(list(frame.columns).index("published") + 1, "difference", [row.difference for row in self.rows])
        return frame

    def grid(self) -> "Grid":
        """Three rows a scene: measured, published, difference."""
        from bench.papers.kinds.scenes.grid import scene_grid

        return scene_grid(self)

    def printed(self) -> "Grid":
        """One row a scene, as the paper prints it."""
        from bench.papers.kinds.scenes.side_by_side import side_by_side

        return side_by_side(self)

    def by_scene(self) -> dict[str, list[Measured]]:
        """The cells of each scene, in the order of the table."""
        scenes: dict[str, list[Measured]] = {}
        for row in self.rows:
            scenes.setdefault(row.scene, []).append(row)
        return scenes

    def columns(self) -> list[tuple[str, str]]:
        """Published column and what is measured for it, for each column of the table."""
        return list(dict.fromkeys((row.quantity, row.method) for row in self.rows if row.quantity not in FACTS))


def number(printed: str) -> float:
    """A number as printed; NaN where none is."""
    return float(printed) if printed else np.nan
