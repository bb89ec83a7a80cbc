"""What a network is worth on graphs that it has not learned from, beside methods that learn nothing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.core.problem import Floats, Instance
from bench.execution.here import solve_here
from bench.plugins.declare import MethodInfo
from bench.plugins.selection import format_selection
from bench.scoring.inference.ratio import Ratio, mean_ratio
from bench.scoring.metrics.errors import camera_errors

FAR_DEG = 10.0
_LEAST_DEG = 1e-3  # errors below it count as it
_THRESHOLD = 1.01  # a ratio nearer to one is no difference


@dataclass(frozen=True, eq=False)
class Judged:
    """One configured method on all held-out graphs.

    Parameters
    ----------
    label
        It as a selection.
    medians, means
        (k,) of the camera errors of each graph, in degrees.
    far
        Share of all cameras that are more than `FAR_DEG` off.
    """

    label: str
    medians: Floats
    means: Floats
    far: float


@dataclass(frozen=True)
class Standing:
    """A row of the table: a method, and how many times the error of the trained one is larger.

    Parameters
    ----------
    label
        The method.
    median_deg, mean_deg, far
        Means over graphs of the median and the mean error, and the share of cameras over `FAR_DEG`.
    ratio
        Trained to this one: geometric mean over graphs of the ratio of median errors; None of the trained one itself.
    """

    label: str
    median_deg: float
    mean_deg: float
    far: float
    ratio: Ratio | None = None

    @property
    def verdict(self) -> str:
        """Whether the trained one is better or worse than this; empty of itself."""
        return "" if self.ratio is None else self.ratio.verdict(self.ratio.p_value, _THRESHOLD)


def judged(info: MethodInfo, parameters: Mapping[str, Any], graphs: Sequence[Instance]) -> Judged:
    """Solve graphs by a method in this process, as `run` would have it solved, and compare with the truth."""
    errors = []
    for graph in graphs:
        assert graph.truth is not None
        errors.append(camera_errors(solve_here(info, parameters, graph.problem).rotations, graph.truth))
    shown = {name: value for name, value in parameters.items() if name != "weights"}
    return Judged(
        format_selection(info.name, shown),
        np.array([np.nanmedian(of_graph) for of_graph in errors]),
        np.array([np.nanmean(of_graph) for of_graph in errors]),
        float(np.nanmean(np.concatenate(errors) > FAR_DEG)),
    )


def standings(trained: Judged, others: Sequence[Judged]) -> list[Standing]:
    """The trained method first, then the others as it compares with them."""
    return [_standing(trained, None), *(_standing(other, _ratio(trained, other)) for other in others)]


def verdict(rows: Sequence[Standing]) -> str:
    """What may be said of the weights, in one sentence: no more than the held-out graphs show."""
    told = {"better": "better than", "worse": "worse than", "cannot tell": "not told apart from"}
    return f"on held-out graphs {', '.join(f'{told[row.verdict]} {row.label}' for row in rows if row.ratio)}"


def _standing(of: Judged, ratio: Ratio | None) -> Standing:
    return Standing(of.label, float(of.medians.mean()), float(of.means.mean()), of.far, ratio)


def _ratio(trained: Judged, other: Judged) -> Ratio:
    new, old = (np.maximum(of.medians, _LEAST_DEG) for of in (trained, other))
    return mean_ratio([Ratio(float(value)) for value in new / old])
