"""How precise a settled solution is if errors are independent, and the loss with which it is most so."""

from typing import NamedTuple

import numpy as np

from bench import Floats, Ints, Problem

from ..descent.descent import Descent
from ..descent.iterate import floored
from ..loops.edge_kernels import compiled
from .correlation import correlation
from .propagation import MOST_LEVERAGE
from .settling import CAUCHY, GEMAN_MCCLURE, Settling, wider_scales

WIDER = (2.0, 4.0, 8.0)  # times the scales of the cameras
NARROWER = (0.5, 0.25)  # times the scales, of the Cauchy loss
INDEPENDENT = 0.2  # chance that errors are correlated, from which on this is not tried
STEPS, STEPS_OF_CAUCHY = 5, 8  # of least squares at each
HOPE = 1.05  # times the best standard error so far; wider losses are tried that promise less than that as residuals are


class Fit(NamedTuple):
    """A solution with the loss that it is settled with.

    Parameters
    ----------
    cameras
        (n, 4).
    scales, power
        Of the loss: (n,) radians, and q of `Settling`.
    errors
        (n,) standard errors of the cameras along an axis, radians.
    """

    cameras: Floats
    scales: Floats
    power: int
    errors: Floats


def standard_error(problem: Problem, prior: Floats, angles: Floats, scales: Floats, power: int) -> float:
    """Standard deviation of a camera along an axis, over its scale: the median over the cameras.

    The sandwich of M-estimation: with psi(r) = p w(r) r, p = c / s^2 and w = (1 + (r / s)^2)^-q, the variance of a
    camera is sum |psi|^2 / 3 over (sum p (w + r w' / 3))^2, sums over its edges, its neighbours held. Residuals are
    first divided by 1 - h, h being the leverage of the edge (its weight times 1 / D_i + 1 / D_j, D the sums of the
    weights at its cameras), since a solution bends to what it is fitted to.

    Parameters
    ----------
    prior, angles
        (m,) c, and residuals in radians.
    scales
        (n,) of the cameras, radians; an edge has the larger one of its two.
    power
        q.
    """
    squares, slopes = np.zeros(problem.n), np.zeros(problem.n)
    _sandwich(problem.edges, prior, angles, scales, power, squares, slopes)
    errors = np.where(slopes > 0, np.sqrt(squares) / np.where(slopes > 0, slopes, 1.0), np.inf)
    return float(np.median(errors / scales))


@compiled
def _sandwich(
    edges: Ints, prior: Floats, angles: Floats, scales: Floats, power: int, squares: Floats, slopes: Floats
) -> None:
    """Add to `squares` and `slopes` (n,) the two sums of `standard_error`."""
    weights, strength = np.empty(len(edges)), np.zeros(len(squares))
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        wider = max(scales[i], scales[j])
        weights[e] = prior[e] / wider**2 / (1 + (angles[e] / wider) ** 2) ** power
        strength[i] += weights[e]
        strength[j] += weights[e]
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        wider = max(scales[i], scales[j])
        leverage = min(weights[e] * (1 / strength[i] + 1 / strength[j]), MOST_LEVERAGE)
        angle = angles[e] / (1 - leverage)
        square = (angle / wider) ** 2
        weight = prior[e] / wider**2 / (1 + square) ** power
        pull, slope = (weight * angle) ** 2 / 3, weight * (1 - 2 / 3 * power * square / (1 + square))
        squares[i] += pull
        squares[j] += pull
        slopes[i] += slope
        slopes[j] += slope


def most_precise(problem: Problem, settling: Settling, descent: Descent, scales: Floats) -> Fit:
    """Settle with the loss that makes cameras most precise; the descent ends there.

    From the scales at which some edges agree with a camera, wider ones are tried: the better, the more normal the
    errors are. Simulated errors are best averaged over many edges, real ones are not. A camera whose scale is wider
    than most keeps it. Where none is better, errors may crowd near zero: the Cauchy loss, which weighs far residuals
    more than Geman and McClure's, is tried with narrower scales. It believes many edges a little, which is right only
    where their errors are independent: residuals cannot tell how much correlated ones would mislead it.

    Parameters
    ----------
    scales
        (n,) radians, those that the descent is settled with.
    """

    def errors(wide: Floats, power: int) -> Floats:
        return wide * standard_error(problem, settling.prior, descent.angles, wide, power)

    def tried(best: Fit, wide: Floats, power: int, steps: int) -> Fit:
        for _ in range(steps):
            descent.step(floored(settling.weights(descent.angles, wide, power)))
        found = Fit(descent.cameras.copy(), wide, power, errors(wide, power))
        return found if np.median(found.errors) < np.median(best.errors) else best

    narrow = best = Fit(descent.cameras.copy(), scales, GEMAN_MCCLURE, errors(scales, GEMAN_MCCLURE))
    usual = np.median(scales)
    for factor in WIDER:
        wide = np.maximum(scales, factor * np.minimum(scales, usual))
        if np.median(errors(wide, GEMAN_MCCLURE)) > HOPE * np.median(best.errors):
            break
        best = tried(best, wide, GEMAN_MCCLURE, STEPS)
    if best is narrow:
        descent.move_to(narrow.cameras)
    if best is narrow and _independent(problem, descent, scales):
        for factor in NARROWER:
            best = tried(best, factor * scales, CAUCHY, STEPS_OF_CAUCHY)
    descent.move_to(best.cameras)
    return best


def _independent(problem: Problem, descent: Descent, scales: Floats) -> bool:
    wider = wider_scales(problem.edges, scales)
    return correlation(problem, descent.vectors, descent.angles, wider) < INDEPENDENT
