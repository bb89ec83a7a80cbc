"""Reweighted least squares in which every camera has the scale at which enough of its edges agree with it."""

import math

import numpy as np

from bench import Floats, Ints, Problem

from ..descent.descent import Descent
from ..descent.iterate import floored
from ..loops.edge_kernels import compiled
from .half_edges import HalfEdges

NARROWEST, WIDEST = np.radians([0.02, 60.0])
HALVINGS = 10  # of the interval in which a scale is sought, on a logarithmic axis: to one percent
SHARE = 0.3  # of the edges at a camera; more need not agree
FEWEST, MOST = 2.0, 0.6  # but two must, or 60 % of fewer than four edges


class Settling:
    """Cameras that come to rest where each agrees with several of its edges, on whatever scale that is.

    The scale s_i of a camera is the smallest at which its edges' (1 + (r / s_i)^2)^-2 sum to `agreeing`, r being the
    residuals; an edge has the larger scale of its cameras, s_ij, and the weight c_ij s_ij^-2 (1 + (r / s_ij)^2)^-2 of
    the Geman-McClure loss of a measurement of that precision, c_ij its prior weight.
    """

    def __init__(self, problem: Problem, half: HalfEdges, prior: Floats, agreeing: int) -> None:
        self.prior = prior
        self._edges, self._half = problem.edges, half
        fewest = np.minimum(FEWEST, MOST * problem.degree)
        self._needed = np.maximum(np.minimum(agreeing, SHARE * problem.degree), fewest)

    def scales(self, angles: Floats) -> Floats:
        """(n,) s_i for residuals (m,), radians."""
        result = np.empty(len(self._needed))
        _agreeing_scales(self._half.first, self._half.ids, angles, self._needed, NARROWEST, WIDEST, result)
        return result

    def weights(self, angles: Floats, scales: Floats) -> Floats:
        """(m,) weights for residuals (m,) and scales (n,) of the cameras."""
        wider = wider_scales(self._edges, scales)
        return self.prior / (wider * (1 + (angles / wider) ** 2)) ** 2

    def settle(self, descent: Descent, start: float, steps: int) -> Floats:
        """Move the cameras, in `steps`, with scales that fall from `start` to those of the cameras; the scales (n,)."""
        for step in range(steps):
            reached = step / (steps - 1)
            scales = self.scales(descent.angles)
            wide = np.maximum(start ** (1 - reached) * scales**reached, scales)
            descent.step(floored(self.weights(descent.angles, wide)))
        return self.scales(descent.angles)


def wider_scales(edges: Ints, scales: Floats) -> Floats:
    """(m,) the larger of the scales (n,) of the two cameras of each edge (m, 2)."""
    return np.maximum(scales[edges[:, 0]], scales[edges[:, 1]])


@compiled
def _agreeing_scales(
    first: Ints, ids: Ints, angles: Floats, needed: Floats, narrowest: float, widest: float, scales: Floats
) -> None:
    """Fill `scales` (n,), see `Settling`; `needed` (n,) is what the sum has to reach, in vain at `widest`."""
    for i in range(len(first) - 1):
        low, high = narrowest, widest
        for _ in range(HALVINGS):
            middle, total = math.sqrt(low * high), 0.0
            for h in range(first[i], first[i + 1]):
                share = 1 / (1 + (angles[ids[h]] / middle) ** 2)
                total += share * share
            if total < needed[i]:
                low = middle
            else:
                high = middle
        scales[i] = high
