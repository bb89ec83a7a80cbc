"""How far each measurement is to be trusted before any other is looked at."""

import numpy as np

from bench import Floats, Problem

from ..graph.confidence import confidence

FAINT = 1e-2  # of a measurement that gravity contradicts


def prior_weights(problem: Problem, scale: float) -> Floats:
    """(m,) the `confidence`, and where gravity is known, less of it for measurements that contradict it.

    R_ij takes gravity as camera j sees it to gravity as camera i does, up to an angle t; the factor is
    (1 + (t / scale)^2)^-2, at least 0.01, and 1 where gravity is unknown at an end. It tells wrong tilts only, not
    wrong headings.

    Parameters
    ----------
    scale
        Radians.
    """
    if problem.gravity is None:
        return confidence(problem)
    i, j = problem.edges.T
    down = problem.gravity
    carried = np.einsum("mab,mb->ma", problem.rotations, down[j])
    tilt = 2 * np.arcsin(np.minimum(np.linalg.norm(carried - down[i], axis=1) / 2, 1.0))
    agreement = np.maximum((1 + (tilt / scale) ** 2) ** -2, FAINT)
    return confidence(problem) * np.where(np.isfinite(tilt), agreement, 1.0)
