"""Reweighted least squares whose weights come from residuals and from cycles, as in MPLS and DESC."""

from collections.abc import Callable

import numpy as np

from bench import Estimate, Floats, Problem, so3

from ..graph.confidence import confidence
from .descent import Descent
from .iterate import SMALLEST_WEIGHT

LARGEST_WEIGHT = 1e8
KEPT_AT_LEAST = 0.8  # of the edges
KEPT_LESS = 0.05  # each iteration


def refined(
    problem: Problem,
    start: Floats,
    levels: Floats,
    levels_by_cycles: Callable[[Floats], Floats],
    tolerance_deg: float,
    iterations: int,
) -> Estimate:
    """Alternate weighted least squares in the tangent space with new weights.

    In iteration t = 1, 2, ... all cameras move to the minimum of sum_ij c_ij w_ij |x_i - x_j - b_ij|^2, where
    exp(b_ij) = R_i^T R_ij R_j and c is the `confidence` of the edges; then the level of each edge becomes
    h_ij / (t + 1) + r_ij t / (t + 1), r_ij being its residual divided by pi. A weight is w_ij = level^(-3/2), at most
    1e8; the worst edges, one in twenty more each iteration up to one in five, get the smallest weight, 1e-10 of the
    largest.

    Deviations from both authors' codes: the smallest weight is relative (theirs is 1e-8, so that weights span 16
    decades, more than a factorization in double precision bears); residuals are those of the moved cameras, not of
    the linear system; the mean step is removed instead of anchoring a camera.

    Parameters
    ----------
    start, levels
        Rotations (n, 3, 3) and estimates of the corruption (m,) to begin with.
    levels_by_cycles
        Gives h (m,) for the normalised residuals r (m,).
    tolerance_deg
        Mean step at which it ends.
    iterations
        Limit.

    Returns
    -------
    Estimate
        Its `edge_weights` are the c_ij level^(-3/2) at the end, the worst edges included, so that they rank all edges.
    """
    trust = confidence(problem)
    descent = Descent(problem, start, np.radians(tolerance_deg))
    kept, converged = 1.0, False
    while not converged and descent.iterations < iterations:
        converged = descent.step(trust * _weights(levels, kept)) < np.radians(tolerance_deg)
        residuals = descent.angles / np.pi
        share = 1 / (descent.iterations + 1)
        levels = share * levels_by_cycles(residuals) + (1 - share) * residuals
        kept = max(KEPT_AT_LEAST, kept - KEPT_LESS)
    return Estimate(
        so3.from_quaternion(descent.cameras),
        edge_weights=trust * _weights(levels, 1.0, smallest=0.0),
        iterations=descent.iterations,
        stop_reason=f"mean step below {tolerance_deg:g} degrees" if converged else "iteration limit",
    )


def _weights(levels: Floats, kept: float, smallest: float = SMALLEST_WEIGHT) -> Floats:
    """Weights (m,) for `levels` (m,), of which the share `kept` that is lowest counts."""
    weights = np.maximum(levels, LARGEST_WEIGHT ** (-2 / 3)) ** -1.5
    weights[levels > np.quantile(levels, kept)] = 0
    return np.maximum(weights, smallest * weights.max())
