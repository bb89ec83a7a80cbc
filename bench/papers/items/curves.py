"""A figure of errors on simulated problems against one of their parameters, with panels for another."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bench.core import outcome
from bench.core.problem import Floats
from bench.papers.computed import Computed, extended, label, one, spelled
from bench.plugins.catalog import catalog
from bench.scoring.inference.statistics import seed_half_width
from bench.scoring.metrics.theory import cramer_rao_rms_deg
from bench.suite.experiment import Suite
from bench.suite.plan import Job

if TYPE_CHECKING:
    import pandas as pd


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


@dataclass(frozen=True)
class CurvePlot:
    """Layout of such a figure.

    Parameters
    ----------
    title
        What the figure shows.
    dataset
        Selection of what stays the same.
    panel, axis
        What differs between panels, and along the horizontal axis.
    curves
        What is drawn.
    statistic, alignment
        What is drawn of the errors, and the rule that removes the gauge.
    seeds, timeout_s, memory_gib
        As in a suite.
    """

    title: str
    dataset: str
    panel: Axis
    axis: Axis
    curves: tuple[Curve, ...]
    statistic: Literal["mean_deg", "median_deg", "rms_deg"]
    alignment: str
    seeds: int = 10
    timeout_s: float = 600.0
    memory_gib: float = 8.0

    def suites(self, name: str) -> tuple[Suite, ...]:
        """What has to run: a suite for each variant of the dataset."""
        methods: dict[tuple[str, ...], list[str]] = {}
        for curve in (curve for curve in self.curves if curve.method):
            datasets = tuple(text for _, _, text in self._problems(curve))
            methods.setdefault(datasets, []).append(curve.method)
        return tuple(
            Suite(name, self.title, datasets, tuple(texts), self.seeds, self.timeout_s, self.memory_gib)
            for datasets, texts in methods.items()
        )

    def points(self, computed: Computed) -> "pd.DataFrame":
        """What the figure shows, one row for each point.

        Returns
        -------
        DataFrame
            The panel's and the axis' parameter, ``curve, method, dataset, seeds, ok`` (how many seeds there were and
            how many ended well), the statistic's mean over these (of ``rms_deg``: the root of the mean square),
            ``half_width_deg`` of its 95 % t interval and ``scored_percent`` of the cameras: fewer than all where a
            graph is not connected.
        """
        import pandas as pd

        assert computed.results is not None  # simulated data are never missing
        scores = computed.results.frame.set_index("job")
        by_dataset: dict[str, list[Job]] = {}
        for job in computed.jobs:
            by_dataset.setdefault(job.dataset, []).append(job)
        rows = []
        for curve in self.curves:
            method = label("method", curve.method) if curve.method else ""
            for panel, x, text in self._problems(curve):
                dataset = label("dataset", text)
                jobs = by_dataset[dataset]
                if method:
                    found = scores.loc[[job.id for job in jobs if spelled(job) == method]]
                    well = found[found["status"] == outcome.OK]
                    errors = well[self.statistic].to_numpy(dtype=float)
                    seeds, scored = len(found), 100 * well["n_scored"].sum() / max(1, well["n_cameras"].sum())
                else:
                    errors = _bounds(jobs, computed)
                    seeds, scored = len(errors), 100.0
                mean, half_width = _averaged(errors, self.statistic)
                rows.append(
                    {
                        self.panel.parameter: panel,
                        self.axis.parameter: x,
                        "curve": curve.label,
                        "method": method,
                        "dataset": dataset,
                        "seeds": seeds,
                        "ok": len(errors),
                        self.statistic: mean,
                        "half_width_deg": half_width,
                        "scored_percent": scored,
                    }
                )
        return pd.DataFrame(rows)

    def _problems(self, curve: Curve) -> Iterator[tuple[int | float, int | float, str]]:
        """Panel, place on the axis, and the selection of the dataset there."""
        for panel in self.panel.values:
            for x in self.axis.values:
                varied = {self.panel.parameter: panel, self.axis.parameter: x}
                yield panel, x, extended(self.dataset, {**varied, **curve.dataset})


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
