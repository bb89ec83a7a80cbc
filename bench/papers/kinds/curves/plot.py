"""What a layout says of a figure of curves, and its points."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bench.core.problem import Floats
from bench.papers.computed import Computed, extended, label, one
from bench.papers.item import Comparison, MeasuredItem
from bench.papers.published import Sources
from bench.plugins.catalog import catalog
from bench.scoring.inference.statistics import seed_half_width
from bench.scoring.metrics.theory import cramer_rao_rms_deg
from bench.suite.experiment import Suite
from bench.suite.plan import Job

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from bench.reporting.tables.grid import Grid


@dataclass(frozen=True)
class Axis:
    """A parameter of the dataset that is varied; in a panel's label, ``{}`` stands for its value."""

    parameter: str
    label: str
    values: tuple[int | float, ...]


@dataclass(frozen=True)
class Curve:
    """What one line shows.

    Parameters
    ----------
    label
        Its name.
    method
        A selection; "" for the Cramér-Rao bound of the problems, see `bench.scoring.metrics.theory`.
    dataset
        Added to the dataset's parameters.
    reference
        Whether it is a reference line, and no contestant.
    """

    label: str
    method: str = ""
    dataset: Mapping[str, Any] = field(default_factory=dict)
    reference: bool = False


@dataclass(frozen=True, kw_only=True)
class CurvePlot(MeasuredItem):
    """Layout of such a figure.

    Parameters
    ----------
    dataset
        Selection of what stays the same.
    panel, axis
        What differs between panels, and along the horizontal axis.
    curves
        What is drawn.
    statistic
        What is drawn of the errors.
    """

    dataset: str
    panel: Axis
    axis: Axis
    curves: tuple[Curve, ...]
    statistic: Literal["mean_deg", "median_deg", "rms_deg"]
    seeds: int = 10

    def suites(self, name: str) -> tuple[Suite, ...]:
        """What has to run: a suite for each variant of the dataset."""
        methods: dict[tuple[str, ...], list[str]] = {}
        for curve in (curve for curve in self.curves if curve.method):
            datasets = tuple(text for _, _, text in self._problems(curve))
            methods.setdefault(datasets, []).append(curve.method)
        return tuple(self.suite(name, datasets, texts) for datasets, texts in methods.items())

    def with_methods(self, methods: Sequence[str]) -> "CurvePlot":
        """The figure with a curve for each of these, under its selection."""
        return replace(self, curves=(*self.curves, *(Curve(text, text) for text in methods)))

    def compare(self, sources: Sources, computed: Computed) -> "Curves":
        """The points of every curve; nothing is published in numbers."""
        points = tuple(
            self._point(curve, panel, x, label("dataset", text), computed)
            for curve in self.curves
            for panel, x, text in self._problems(curve)
        )
        return Curves(self, points, computed)

    def _point(self, curve: Curve, panel: int | float, x: int | float, dataset: str, computed: Computed) -> "Point":
        method = computed.spelled(curve.method) if curve.method else ""
        if method:
            found = [score for score in computed.scores if (score.dataset, score.method) == (dataset, method)]
            well = [score for score in found if score.ok]
            errors = np.array([getattr(score, self.statistic) for score in well], dtype=float)
            cameras = sum(score.n_cameras for score in well)
            seeds, scored = len(found), 100 * sum(score.n_scored for score in well) / max(1, cameras)
        else:
            errors = _bounds([job for job in computed.jobs if job.dataset == dataset], computed)
            seeds, scored = len(errors), 100.0
        mean, half_width = _averaged(errors, self.statistic)
        return Point(panel, x, curve.label, method, dataset, seeds, len(errors), mean, half_width, scored)

    def _problems(self, curve: Curve) -> Iterator[tuple[int | float, int | float, str]]:
        """Panel, place on the axis, and the selection of the dataset there."""
        for panel in self.panel.values:
            for x in self.axis.values:
                varied = {self.panel.parameter: panel, self.axis.parameter: x}
                yield panel, x, extended(self.dataset, {**varied, **curve.dataset})


@dataclass(frozen=True)
class Point:
    """A point of a curve.

    Parameters
    ----------
    panel, x
        The panel's and the axis' parameter.
    seeds, ok
        How many there were, and how many ended well.
    error_deg, half_width_deg
        The statistic's mean over these (of ``rms_deg``: the root of the mean square), and of its 95 % t interval.
    scored_percent
        Of the cameras: fewer than all where a graph is not connected.
    """

    panel: int | float
    x: int | float
    curve: str
    method: str
    dataset: str
    seeds: int
    ok: int
    error_deg: float
    half_width_deg: float
    scored_percent: float


@dataclass(frozen=True)
class Curves(Comparison):
    """The figure, computed."""

    plot: CurvePlot
    rows: tuple[Point, ...]
    computed: Computed

    def frame(self) -> "pd.DataFrame":
        """A row for each `Point`; the columns of the two parameters and of the statistic bear their names."""
        plot = self.plot
        names = {"panel": plot.panel.parameter, "x": plot.axis.parameter, "error_deg": plot.statistic}
        return super().frame().rename(columns=names)

    def grid(self) -> "Grid":
        """A row for each panel and place on the axis, a column for each curve."""
        from bench.reporting.tables.grid import Cell, Grid
        from bench.reporting.tables.printed import degrees

        def text(point: Point) -> str:
            spread = f" ±{degrees(point.half_width_deg)}" if math.isfinite(point.half_width_deg) else ""
            partly = f" ({point.ok}/{point.seeds})" if point.ok < point.seeds else ""
            return f"{degrees(point.error_deg)}{spread}{partly}"

        plot = self.plot
        places: dict[tuple[float, float], dict[str, Point]] = {}
        for point in self.rows:
            places.setdefault((point.panel, point.x), {})[point.curve] = point
        curves = [curve.label for curve in plot.curves]
        return Grid(
            caption=f"{plot.title}; degrees, {self.computed.alignment} alignment, {plot.dataset}",
            facts=(plot.panel.parameter, plot.axis.parameter),
            methods=tuple((name, "") for name in curves),
            rows=tuple(
                (tuple(f"{value:g}" for value in place), tuple(Cell(text(by_curve[name])) for name in curves))
                for place, by_curve in places.items()
            ),
            notes=tuple(self.notes()),
        )

    def notes(self) -> Iterator[str]:
        """What the figures are means of, and what is noted of problems and methods."""
        seeds = max(point.seeds for point in self.rows)
        yield f"Means over {seeds} seeds with their 95 % t intervals." if seeds > 1 else "One seed."
        names = {job.dataset: job.instance for job in self.computed.jobs}
        said: dict[str, list[str]] = {}
        for curve in dict.fromkeys(point.curve for point in self.rows):
            own = [point for point in self.rows if point.curve == curve]
            remarks = [note for point in own for note in self.computed.notes.get(names.get(point.dataset, ""), ())]
            if (share := min(point.scored_percent for point in own)) < 100:
                remarks.append(
                    f"solved and scored on the largest component of each graph, at least {share:.1f} % of the cameras"
                )
            for note in dict.fromkeys(remarks):
                said.setdefault(note, []).append(curve)
        yield from (f"{' and '.join(curves)}: {note}." for note, curves in said.items())
        if any(point.ok < point.seeds for point in self.rows):
            yield "(k/s): only k of s seeds ended well."

    def figure(self) -> "Figure":
        """Curves with their bands; the vertical axis is logarithmic."""
        from bench.papers.kinds.curves.figure import draw

        return draw(self)


def _bounds(jobs: Sequence[Job], computed: Computed) -> Floats:
    """Cramér-Rao bounds on the RMS error of each instance, in degrees."""
    assert computed.instance is not None
    name, given = one("dataset", jobs[0].dataset)
    noise, noise_deg = ({**catalog("dataset")[name].defaults(), **given}[key] for key in ("noise", "noise_deg"))
    bounds = []
    for job in {job.instance_key: job for job in jobs}.values():
        instance = computed.instance(job)
        assert instance.outliers is not None
        bounds.append(cramer_rao_rms_deg(instance.problem, ~instance.outliers, noise, noise_deg))
    return np.array(bounds)


def _averaged(errors: Floats, statistic: str) -> tuple[float, float]:
    """Average over seeds and the half-width of its interval; of root mean squares the squares are averaged."""
    if not len(errors):
        return np.nan, np.nan
    if statistic != "rms_deg":
        return float(errors.mean()), seed_half_width(errors.tolist())
    rms = float(np.sqrt((errors**2).mean()))
    return rms, seed_half_width((errors**2).tolist()) / (2 * rms) if rms > 0 else 0.0
