"""How precise a settled solution is if errors are independent, and the width of the loss at which it is most so."""

import numpy as np

from bench import Floats, Problem

from ..descent.descent import Descent
from ..descent.iterate import floored
from .settling import Settling, wider_scales

WIDER = (2.0, 4.0, 8.0)  # times the scales of the cameras
STEPS = 5  # of least squares at each
HOPE = 1.05  # times the best standard error so far; wider losses are tried that promise less than that as residuals are
MOST_LEVERAGE = 0.9


def standard_error(problem: Problem, prior: Floats, angles: Floats, scales: Floats) -> float:
    """Standard deviation of a camera along an axis, over its scale: the median over the cameras.

    The sandwich of M-estimation: with psi(r) = p w(r) r, p = c / s^2 and w = (1 + (r / s)^2)^-2, the variance of a
    camera is sum |psi|^2 / 3 over (sum p (w + r w' / 3))^2, sums over its edges, its neighbours held. Residuals are
    first divided by 1 - h, h being the leverage of the edge (its weight times 1 / D_i + 1 / D_j, D the sums of the
    weights at its cameras), since a solution bends to what it is fitted to.

    Parameters
    ----------
    prior, angles
        (m,) c, and residuals in radians.
    scales
        (n,) of the cameras, radians; an edge has the larger one of its two.
    """
    i, j = problem.edges.T
    n = problem.n

    def sums(values: Floats) -> Floats:
        return np.asarray(np.bincount(i, values, n) + np.bincount(j, values, n))

    wider = wider_scales(problem.edges, scales)
    precision = prior / wider**2
    weights = precision / (1 + (angles / wider) ** 2) ** 2
    strength = sums(weights)
    leverage = np.minimum(weights * (1 / strength[i] + 1 / strength[j]), MOST_LEVERAGE)
    angles = angles / (1 - leverage)
    square = (angles / wider) ** 2
    weight = 1 / (1 + square) ** 2
    meat = sums((precision * weight * angles) ** 2 / 3)
    bread = sums(precision * weight * (1 - 4 / 3 * square / (1 + square)))
    errors = np.where(bread > 0, np.sqrt(meat) / np.where(bread > 0, bread, 1.0), np.inf)
    return float(np.median(errors / scales))


def widened(problem: Problem, settling: Settling, descent: Descent, scales: Floats) -> tuple[Floats, Floats]:
    """Settle at the width of the loss that makes cameras most precise; the scales (n,) there, and standard errors (n,).

    From the scales at which some edges agree with a camera, wider ones are tried: the better, the more normal the
    errors are. Simulated errors are best averaged over many edges, real ones are not. A camera whose scale is wider
    than most keeps it.
    """
    best, errors = scales, scales * standard_error(problem, settling.prior, descent.angles, scales)
    cameras, before = descent.cameras.copy(), descent.angles.copy()
    for factor in WIDER:
        wide = np.maximum(scales, factor * np.minimum(scales, np.median(scales)))
        if np.median(wide) * standard_error(problem, settling.prior, before, wide) > HOPE * np.median(errors):
            break
        for _ in range(STEPS):
            descent.step(floored(settling.weights(descent.angles, wide)))
        there = wide * standard_error(problem, settling.prior, descent.angles, wide)
        if np.median(there) < np.median(errors):
            best, errors, cameras = wide, there, descent.cameras.copy()
    descent.move_to(cameras)
    return best, errors
