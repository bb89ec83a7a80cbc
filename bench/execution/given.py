"""What a method is given of a problem, and its estimate put back into the whole."""

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core.problem import Estimate, Floats, Problem


@dataclass(frozen=True, eq=False)
class Given:
    """The connected part of a problem that a method is to solve.

    Parameters
    ----------
    whole, problem
        The problem, and what is given of it: its largest component.
    cameras
        (k,) the cameras of the whole that are given.
    edges
        (m,) whether each edge of the whole is given.
    """

    whole: Problem
    problem: Problem
    cameras: NDArray[np.intp]
    edges: NDArray[np.bool_]

    @classmethod
    def of(cls, whole: Problem) -> "Given":
        """What is given of a problem; the problem itself where that is connected."""
        cameras = np.flatnonzero(whole.components == 0)
        if len(cameras) == whole.n:
            return cls(whole, whole, cameras, np.ones(whole.m, bool))
        part, edges = whole.subgraph(cameras)
        return cls(whole, part, cameras, edges)

    def restored(self, estimate: Estimate) -> Estimate:
        """The estimate for the whole graph, NaN for what was not given."""
        if self.problem is self.whole:
            return estimate
        weights = estimate.edge_weights
        note = f"disconnected graph: solved on its largest component, {len(self.cameras)} of {self.whole.n} cameras"
        return dataclasses.replace(
            estimate,
            rotations=_spread(estimate.rotations, self.whole.n, self.cameras),
            edge_weights=None if weights is None else _spread(np.asarray(weights), self.whole.m, self.edges),
            checkpoints=tuple(
                dataclasses.replace(c, rotations=_spread(c.rotations, self.whole.n, self.cameras))
                for c in estimate.checkpoints
            ),
            notes=(*estimate.notes, note),
        )


def _spread(values: Floats, size: int, where: Any) -> Floats:
    out = np.full((size, *values.shape[1:]), np.nan)
    out[where] = values
    return out
