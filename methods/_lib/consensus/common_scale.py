"""One scale for all cameras, where those of single cameras tell nothing."""

import numpy as np

from bench import Floats, Problem

from ..descent.descent import Descent
from ..descent.iterate import floored
from .efficiency import Fit
from .propagation import strengths, without_own_edge
from .settling import GEMAN_MCCLURE, Settling

STEPS = 5  # of least squares at each scale
NARROWEST = np.radians(0.02)


def with_common_scale(problem: Problem, settling: Settling, descent: Descent, first: float, widest: float) -> Fit:
    """Settle with the Geman-McClure loss of the one scale with which cameras are most precise; the descent ends there.

    Where a camera has four edges, two that agree with it do not tell how noisy they are: along a tree, as many agree
    whatever was measured. So all cameras have one scale s, and all residuals together tell which. From the `first`
    on it is doubled as long as that is better than the half of it, or else halved until that is not. Either is asked
    where cameras are settled with the wider one, see `_variance`: residuals that are settled with a narrow loss are
    small where they are because the cameras gave in to them.

    Parameters
    ----------
    first, widest
        Scales in radians.
    """

    def prefers(scale: float) -> bool:
        scales = np.full(problem.n, scale)
        for _ in range(STEPS):
            descent.step(floored(settling.weights(descent.angles, scales)))
        without = without_own_edge(problem, settling.weights(descent.angles, scales), descent.angles)
        own, narrower = (_variance(problem, settling.prior, without, s) for s in (scale, scale / 2))
        return own <= narrower

    scale = first
    if prefers(scale):
        best = descent.cameras.copy()
        while 2 * scale <= widest and prefers(2 * scale):
            scale, best = 2 * scale, descent.cameras.copy()
        descent.move_to(best)
    else:
        scale /= 2
        while not prefers(scale) and scale > NARROWEST:
            scale /= 2
    return Fit(
        descent.cameras.copy(), np.full(problem.n, scale), GEMAN_MCCLURE, _errors(problem, settling, descent, scale)
    )


def _errors(problem: Problem, settling: Settling, descent: Descent, scale: float) -> Floats:
    """(n,) standard errors of the cameras along an axis, their neighbours held."""
    weights = settling.weights(descent.angles, np.full(problem.n, scale))
    variance = _variance(problem, settling.prior, descent.angles, scale)
    return np.sqrt(variance * weights.mean() / strengths(problem, weights))


def _variance(problem: Problem, prior: Floats, angles: Floats, scale: float) -> float:
    """Variance along an axis of what an edge tells, with the loss of a scale: that of an M-estimate times its edges.

    E[psi^2] / 3 over E[psi']^2, for residuals (m,), times m' / (m' - n + 1): to m' edges n - 1 rotations are fitted,
    m' being (sum w)^2 / sum w^2; infinite where these are no more. The constant of a loss is chosen by the least such
    variance by Wang, Lin, Zhu and Bai (Journal of Computational and Graphical Statistics 16, 2007). Where there are
    few measurements for each unknown, what counts are residuals of fits without the own measurement (El Karoui et
    al., PNAS 110, 2013).
    """
    squares = (angles / scale) ** 2
    weights = prior / (1 + squares) ** 2
    edges = weights.sum() ** 2 / (weights**2).sum()
    slope = (weights * (1 - 4 / 3 * squares / (1 + squares))).mean()
    if edges <= problem.n - 1 or slope <= 0:
        return np.inf
    return float(((weights * angles) ** 2).mean() / 3 / slope**2 * edges / (edges - problem.n + 1))
