"""Reweighted least squares in which every camera has the scale at which enough of its edges agree with it."""

import math

import numpy as np

from bench import Floats, Ints, Problem

from ..descent.descent import Descent
from ..descent.iterate import floored
from ..loops.edge_kernels import compiled
from .half_edges import HalfEdges

NARROWEST, WIDEST, FIRST = np.radians([0.02, 60.0, 2.0])  # scales; the first that is tried
CLOSE, MOST_TRIALS = 0.02, 12  # of the sum that has to be reached, and of scales that are tried for a camera
SHARE = 0.3  # of the edges at a camera; more need not agree
GEMAN_MCCLURE, CAUCHY = 2, 1  # q of the weights
FEWEST, MOST = 2.0, 0.6  # but two must, or 60 % of fewer than four edges


class Settling:
    """Cameras that come to rest where each agrees with several of its edges, on whatever scale that is.

    The scale s_i of a camera is the smallest at which its edges' (1 + (r / s_i)^2)^-2 sum to `agreeing`, r being the
    residuals; an edge has the larger scale of its cameras, s_ij, and the weight c_ij s_ij^-2 (1 + (r / s_ij)^2)^-q of
    a measurement of that precision, c_ij its prior weight: q is 2 for the Geman-McClure loss and 1 for Cauchy's.
    """

    def __init__(self, problem: Problem, half: HalfEdges, prior: Floats, agreeing: int) -> None:
        self.prior = prior
        self._edges, self._half = problem.edges, half
        fewest = np.minimum(FEWEST, MOST * problem.degree)
        self._needed = np.maximum(np.minimum(agreeing, SHARE * problem.degree), fewest)
        self._scales = np.full(problem.n, FIRST)

    def scales(self, angles: Floats) -> Floats:
        """(n,) s_i for residuals (m,), radians; found the faster, the nearer they are to those of the last call."""
        _agreeing_scales(self._half.first, self._half.ids, angles, self._needed, NARROWEST, WIDEST, self._scales)
        return self._scales.copy()

    def weights(self, angles: Floats, scales: Floats, power: int = GEMAN_MCCLURE) -> Floats:
        """(m,) weights for residuals (m,), scales (n,) of the cameras and q."""
        result = np.empty(len(angles))
        _weigh(self._edges, self.prior, angles, scales, power, result)
        return result

    def settle(self, descent: Descent, start: float, steps: int, narrowest: float = 0.0) -> Floats:
        """Move the cameras, in `steps`, with scales that fall from `start` to those of the cameras; the scales (n,).

        None falls below `narrowest`; radians.
        """
        for step in range(steps):
            reached = step / (steps - 1)
            scales = np.maximum(self.scales(descent.angles), narrowest)
            wide = np.maximum(start ** (1 - reached) * scales**reached, scales)
            descent.step(floored(self.weights(descent.angles, wide)))
        return self.scales(descent.angles)


def wider_scales(edges: Ints, scales: Floats) -> Floats:
    """(m,) the larger of the scales (n,) of the two cameras of each edge (m, 2)."""
    return np.maximum(scales[edges[:, 0]], scales[edges[:, 1]])


@compiled
def _weigh(edges: Ints, prior: Floats, angles: Floats, scales: Floats, power: int, weights: Floats) -> None:
    """Fill `weights` (m,), see `Settling`."""
    for e in range(len(edges)):
        square = max(scales[edges[e, 0]], scales[edges[e, 1]]) ** 2
        weight = 1 / (square + angles[e] * angles[e])
        if power == GEMAN_MCCLURE:
            weight *= square * weight
        weights[e] = prior[e] * weight


@compiled
def _agreeing_scales(
    first: Ints, ids: Ints, angles: Floats, needed: Floats, narrowest: float, widest: float, scales: Floats
) -> None:
    """Make `scales` (n,) those of `Settling`, from where they are, by Newton's method between bounds.

    On logarithmic axes, where the sum of (1 + (r / s)^2)^-2 over the edges of a camera is nearly a line.

    Parameters
    ----------
    first, ids
        See `HalfEdges`.
    angles
        (m,) residuals r.
    needed
        (n,) what the sum has to reach, up to a factor `CLOSE`; in vain at `widest`.
    """
    squares = np.empty(np.diff(first).max())
    for i in range(len(first) - 1):
        degree = first[i + 1] - first[i]
        for h in range(degree):
            squares[h] = angles[ids[first[i] + h]] ** 2
        low, high, scale = math.log(narrowest), math.log(widest), math.log(scales[i])
        for _ in range(MOST_TRIALS):
            inverse, total, slope = math.exp(-2 * scale), 0.0, 0.0
            for h in range(degree):
                share = 1 / (1 + squares[h] * inverse)
                total += share * share
                slope += share * share * (1 - share)
            if abs(total - needed[i]) < CLOSE * needed[i]:
                break
            if total < needed[i]:
                low = scale
            else:
                high = scale
            if high - low < CLOSE / 4:
                scale = high
                break
            moved = scale + math.log(needed[i] / total) * total / (4 * slope) if total > 0 and slope > 0 else low
            scale = moved if low < moved < high else (low + high) / 2
        scales[i] = math.exp(scale)
