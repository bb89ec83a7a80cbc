"""A figure of errors on simulated problems against one of their parameters, with panels for another."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bench import selection
from bench.execution import outcome
from bench.experiment import Suite
from bench.papers.computed import Computed, extended, label
from bench.scoring.statistics import seed_half_width

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
    """A method, on the dataset with further parameters; a reference line is no contestant."""

    label: str
    method: str
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
    statistic: Literal["mean_deg", "median_deg"]
    alignment: str
    seeds: int = 10
    timeout_s: float = 600.0
    memory_gib: float = 8.0

    def suites(self, name: str) -> tuple[Suite, ...]:
        """What has to run: a suite for each variant of the dataset."""
        methods: dict[tuple[str, ...], list[str]] = {}
        for curve in self.curves:
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
            how many ended well), the statistic's mean over these, ``half_width_deg`` of its 95 % t interval and
            ``scored_percent`` of the cameras: fewer than all where a graph is not connected.
        """
        import pandas as pd

        assert computed.results is not None  # simulated data are never missing
        scores = computed.results.frame.set_index("job")
        jobs: dict[tuple[str, str], list[str]] = {}
        for job in computed.jobs:
            method = selection.format_selection(job.method, dict(job.parameters))
            jobs.setdefault((job.dataset, method), []).append(job.id)
        rows = []
        for curve in self.curves:
            method = label("method", curve.method)
            for panel, x, text in self._problems(curve):
                dataset = label("dataset", text)
                found = scores.loc[jobs[dataset, method]]
                well = found[found["status"] == outcome.OK]
                values = well[self.statistic].to_numpy(dtype=float)
                rows.append(
                    {
                        self.panel.parameter: panel,
                        self.axis.parameter: x,
                        "curve": curve.label,
                        "method": method,
                        "dataset": dataset,
                        "seeds": len(found),
                        "ok": len(values),
                        self.statistic: values.mean() if len(values) else np.nan,
                        "half_width_deg": seed_half_width(values.tolist()),
                        "scored_percent": 100 * well["n_scored"].sum() / max(1, well["n_cameras"].sum()),
                    }
                )
        return pd.DataFrame(rows)

    def _problems(self, curve: Curve) -> Iterator[tuple[int | float, int | float, str]]:
        """Panel, place on the axis, and the selection of the dataset there."""
        for panel in self.panel.values:
            for x in self.axis.values:
                varied = {self.panel.parameter: panel, self.axis.parameter: x}
                yield panel, x, extended(self.dataset, {**varied, **curve.dataset})
