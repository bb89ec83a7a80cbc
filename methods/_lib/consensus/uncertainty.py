"""How far each camera of a settled solution may be off."""

import numpy as np

from bench import Floats, Problem

from ..descent.descent import Descent
from ..descent.iterate import floored
from .correlation import correlation
from .efficiency import Fit
from .propagation import added_up, strengths, without_own_edge
from .rivals import rival_places
from .settling import wider_scales

SIXTY_EIGHT = 1.87  # length of a standard normal vector in three dimensions that is not exceeded with 68 %
CORRELATED = 1.4  # what covers 68 % on simulated graphs whose errors are correlated at cameras
USUAL = 1.0  # edges of usual misfit that every camera has beside its own


def camera_sigma(
    problem: Problem, descent: Descent, weights: Floats, fit: Fit, noise: float, common_scale: bool
) -> Floats:
    """(n,) angle in radians below which a camera's error is expected with probability 68 %; below twice it with 95 %.

    Were errors independent, it would be 1.87 f_i e_i: e_i is the standard error along an axis with the neighbours held,
    f_i tells how errors add up on their way through the graph (`propagation`). Where the errors at a camera
    point the same way (wrong focal length, one-sided matches) more edges do not help it, and what they have in common
    adds up faster along a sequence: 1.4 f_i^2 q_i, q_i being the root mean square of the residuals of the edges that
    agree with it. How probable that is, p, follows from the residuals outside (`correlation`), and the result is the
    first to the power 1 - p times the second to the power p. Where all cameras have one scale p is zero: it is
    pictures whose errors point the same way, and their triangles do not close as if errors were normal.

    A camera may also stand wrong with its whole piece (`rivals`): where a place at an angle t has a chance of
    5 %, the 95 % radius reaches there, and where of 32 %, the 68 % radius does. What no measurement contradicts, such
    as a scene bent evenly by distorted lenses, cannot be seen.

    Parameters
    ----------
    descent
        At the solution.
    weights
        (m,) of the edges there.
    fit
        The loss there, with e_i as its errors.
    noise
        The noise scale, radians.
    common_scale
        Whether all cameras have one scale.
    """
    weights = floored(weights)
    further = added_up(problem, weights, descent.inverse(weights))
    alone = SIXTY_EIGHT * further * fit.errors
    common = CORRELATED * further**2 * _misfit(problem, weights, descent.angles)
    wider = wider_scales(problem.edges, fit.scales)
    chance = 0.0 if common_scale else correlation(problem, descent.vectors, descent.angles, wider)
    near = np.minimum(alone ** (1 - chance) * np.maximum(alone, common) ** chance, np.pi)
    agreement = 1 / (1 + (descent.angles / wider) ** 2) ** fit.power
    probable, possible = rival_places(problem, descent.vectors, descent.angles, agreement, noise, descent.inverse)
    near = np.maximum(near, np.where(probable > 0, probable + near, 0))
    return np.minimum(np.maximum(near, np.where(possible > 0, possible / 2 + near, 0)), np.pi)


def _misfit(problem: Problem, weights: Floats, angles: Floats) -> Floats:
    """(n,) root mean square of the residuals (m,) at each camera, by weights (m,), with a share of what is usual.

    Residuals are those of `without_own_edge`.
    """
    sums = strengths(problem, weights)
    squares = strengths(problem, weights * without_own_edge(problem, weights, angles) ** 2) / sums
    edges = sums**2 / strengths(problem, weights**2)
    return np.sqrt((edges * squares + USUAL * np.median(squares)) / (edges + USUAL))
