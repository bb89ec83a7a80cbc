"""How far each camera of a settled solution may be off."""

import numpy as np

from bench import Floats, Problem

from .settling import wider_scales

SHELL = 10.0  # scales; edges between one and ten of them tell whether the errors at a camera point the same way
FEWEST = 5  # edges in the shell of a camera that counts
SIXTY_EIGHT = 1.87  # length of a standard normal vector in three dimensions that is not exceeded with 68 %
COHERENT = 1.55  # what makes the result cover 68 % on simulated graphs whose errors are correlated at cameras


def camera_sigma(problem: Problem, vectors: Floats, angles: Floats, scales: Floats, independent: Floats) -> Floats:
    """(n,) angle in radians below which a camera's error is expected with probability 68 %; below twice it with 95 %.

    sigma_i^2 = (1.87 e_i)^2 + (1.55 rho q_i)^2. The first term is that of independent errors, e_i being the standard
    error along an axis. q_i is the root mean square of the residuals of the camera between one and ten scales, and
    rho^2 the share of their variance that the edges of a camera have in common, from the mean residual of each camera
    less what chance gives it: the one-way variance component, one for the graph. Where a camera's errors point the same
    way (wrong focal length, one-sided matches) more edges do not help it, and the independent term alone is far too
    small. Errors that no edge contradicts, as of a folded piece, cannot be seen.

    Parameters
    ----------
    vectors, angles
        (m, 3) and (m,) residuals at the solution, radians.
    scales
        (n,) at which some edges agree with each camera, radians.
    independent
        (n,) e_i, radians.
    """
    wider = wider_scales(problem.edges, scales)
    shell = (angles > wider) & (angles < SHELL * wider)
    ends = problem.edges[shell].T.ravel()
    signed = np.concatenate([vectors[shell], -vectors[shell]])
    counts = np.bincount(ends, minlength=problem.n)
    shares = np.maximum(counts, 1)
    means = np.stack([np.bincount(ends, column, problem.n) for column in signed.T], axis=1) / shares[:, None]
    squares = np.bincount(ends, (signed**2).sum(axis=1), problem.n) / shares
    told = counts >= FEWEST
    k = shares[told]
    common = ((means[told] ** 2).sum(axis=1) - squares[told] / k) * k / (k - 1) / squares[told]
    rho_squared = max(float(common.mean()), 0.0) if told.any() else 0.0
    spread = np.where(counts > 0, squares, scales**2)
    return np.sqrt((SIXTY_EIGHT * independent) ** 2 + COHERENT**2 * rho_squared * spread)
