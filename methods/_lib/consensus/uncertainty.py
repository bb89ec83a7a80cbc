"""How far each camera of a settled solution may be off."""

import numpy as np

from bench import Floats, Problem

from ..descent.descent import Descent
from ..descent.iterate import floored
from .propagation import added_up, strengths
from .rivals import rival_places
from .settling import wider_scales

SIXTY_EIGHT = 1.87  # length of a standard normal vector in three dimensions that is not exceeded with 68 %
CORRELATED = 1.4  # what covers 68 % on simulated graphs whose errors are correlated at cameras
PRIOR = 0.3  # chance that they are, before the residuals are looked at
SHARE, SPREAD = 0.045, 0.03  # what the edges of a camera then have in common: its mean over graphs, and how it varies
NONE = 0.003  # what it may be where errors are independent, since a solution bends to them
OUTSIDE = 2.0  # scales, beyond which residuals tell
USUAL = 1.0  # edges of usual misfit that every camera has beside its own
MOST_LEVERAGE = 0.9


def camera_sigma(
    problem: Problem, descent: Descent, weights: Floats, scales: Floats, independent: Floats, noise: float
) -> Floats:
    """(n,) angle in radians below which a camera's error is expected with probability 68 %; below twice it with 95 %.

    Were errors independent, it would be 1.87 f_i e_i: e_i is the standard error along an axis with the neighbours held,
    f_i tells how errors add up on their way through the graph (`propagation`). Where the errors at a camera
    point the same way (wrong focal length, one-sided matches) more edges do not help it, and what they have in common
    adds up faster along a sequence: 1.4 f_i^2 q_i, q_i being the root mean square of the residuals of the edges that
    agree with it. How probable that is, p, follows from the residuals outside (`correlation`), and the result is the
    first to the power 1 - p times the second to the power p.

    A camera may also stand wrong with its whole piece (`rivals`): where a place at an angle t has a chance of
    5 %, the 95 % radius reaches there, and where of 32 %, the 68 % radius does. What no measurement contradicts, such
    as a scene bent evenly by distorted lenses, cannot be seen.

    Parameters
    ----------
    descent
        At the solution.
    weights
        (m,) of the edges there.
    scales
        (n,) of the cameras, radians.
    independent
        (n,) e_i, radians.
    noise
        The noise scale, radians.
    """
    weights = floored(weights)
    further = added_up(problem, weights, descent.inverse(weights))
    alone = SIXTY_EIGHT * further * independent
    common = CORRELATED * further**2 * _misfit(problem, weights, descent.angles)
    wider = wider_scales(problem.edges, scales)
    chance = correlation(problem, descent.vectors, descent.angles, wider)
    near = np.minimum(alone ** (1 - chance) * np.maximum(alone, common) ** chance, np.pi)
    agreement = 1 / (1 + (descent.angles / wider) ** 2) ** 2
    probable, possible = rival_places(problem, descent.vectors, descent.angles, agreement, noise, descent.inverse)
    near = np.maximum(near, np.where(probable > 0, probable + near, 0))
    return np.minimum(np.maximum(near, np.where(possible > 0, possible / 2 + near, 0)), np.pi)


def correlation(problem: Problem, vectors: Floats, angles: Floats, wider: Floats) -> float:
    """Chance that the errors at a camera point the same way, from residuals beyond two scales.

    The statistic is the share that the edges of a camera have in common of the directions of their residuals (the
    one-way variance component, one for the graph): zero up to its standard error where errors are independent, and over
    simulated graphs of correlated ones 0.045, with standard deviation 0.03, or more.

    Parameters
    ----------
    vectors, angles, wider
        (m, 3), (m,) residuals and (m,) scales of the edges, radians.
    """
    outside = angles > OUTSIDE * wider
    ends = problem.edges[outside].T.ravel()
    directions = vectors[outside] / angles[outside, None]
    signed = np.concatenate([directions, -directions])
    counts = np.bincount(ends, minlength=problem.n)
    told = counts > 1
    if not told.any():
        return PRIOR
    sums = np.stack([np.bincount(ends, column, problem.n) for column in signed.T])
    squares = (sums**2).sum(axis=0)[told] / counts[told]
    pairs = (counts[told] - 1).sum()
    share = (squares - 1).sum() / pairs
    error = np.sqrt(2 / 3 * (1 - 1 / counts[told]).sum()) / pairs
    correlated = PRIOR * _density(min(share - SHARE, 0.0), np.hypot(SPREAD, error))
    independent = (1 - PRIOR) * _density(share, np.hypot(NONE, error))
    return float(correlated / (correlated + independent))


def _density(value: float, deviation: float) -> float:
    """Of a normal distribution of mean zero, up to a constant."""
    return float(np.exp(-((value / deviation) ** 2) / 2) / deviation)


def _misfit(problem: Problem, weights: Floats, angles: Floats) -> Floats:
    """(n,) root mean square of the residuals (m,) at each camera, by weights (m,), with a share of what is usual.

    Residuals are divided by 1 - h, h being the leverage of the edge: its weight over the sums at its two cameras.
    """
    i, j = problem.edges.T
    sums = strengths(problem, weights)
    leverage = np.minimum(weights * (1 / sums[i] + 1 / sums[j]), MOST_LEVERAGE)
    squares = strengths(problem, weights * (angles / (1 - leverage)) ** 2) / sums
    edges = sums**2 / strengths(problem, weights**2)
    return np.sqrt((edges * squares + USUAL * np.median(squares)) / (edges + USUAL))
