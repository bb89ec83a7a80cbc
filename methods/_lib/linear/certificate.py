"""The squared chordal cost and the certificate of its optimum, for every method that minimises it."""

from typing import TYPE_CHECKING

import numpy as np

from bench import Floats, Problem

from ..graph.confidence import confidence
from .eigen import smallest

if TYPE_CHECKING:
    from scipy import sparse

PRECISION = 1e-10  # of the eigenvalue, relative to the largest one
LARGE = 1200  # rows; from here on one eigenvalue alone is found faster than a block
ZERO = 1e-4  # of an eigenvalue, relative to the mean degree
ROUNDING = 4e-15  # of the cost, for each edge


def chordal_cost(problem: Problem, rotations: Floats) -> float:
    """Sum over the edges of confidence times the squared Frobenius norm of R_ij - R_i R_j^T, at R (n, 3, p)."""
    i, j = problem.edges.T
    difference = problem.rotations - rotations[i] @ np.swapaxes(rotations[j], -1, -2)
    return float(np.sum(confidence(problem)[:, None, None] * difference**2))


def weighted_blocks(problem: Problem) -> "sparse.csr_array":
    """G (3n, 3n): R_ij times the confidence of the edge in block (i, j), its transpose in block (j, i)."""
    return problem.block_matrix(confidence(problem))


def multipliers(measurements: "sparse.csr_array", rotations: Floats) -> Floats:
    """Lagrange multipliers (n, 3, 3) of R_i R_i^T = I: the symmetric parts of sum_j R_ij R_j R_i^T.

    Parameters
    ----------
    measurements
        (3n, 3n), the `weighted_blocks`.
    rotations
        (n, 3, p) with orthonormal rows; p is three, or more where they are relaxed.
    """
    gathered = measurements @ rotations.reshape(measurements.shape[0], -1)
    blocks = gathered.reshape(rotations.shape) @ np.swapaxes(rotations, -1, -2)
    return 0.5 * (blocks + np.swapaxes(blocks, -1, -2))


def certificate_matrix(measurements: "sparse.csr_array", blocks: Floats) -> "sparse.bsr_array":
    """Lambda - G (3n, 3n): `blocks` (n, 3, 3) are the diagonal of Lambda, G holds the measurements."""
    from scipy import sparse

    n = len(blocks)
    diagonal = sparse.bsr_array((blocks, np.arange(n), np.arange(n + 1)))
    return (diagonal.tocsr() - measurements).tobsr((3, 3))


def smallest_eigenvalue(problem: Problem, rotations: Floats) -> float:
    """Smallest eigenvalue of Lambda - G, the certificate matrix of `chordal_cost` at the rotations.

    Lambda has the `multipliers` on its diagonal, G holds the measurements. At a global optimum the matrix is
    positive semidefinite with R in its kernel (Eriksson et al. 2018). The value bounds the gap anywhere,
    critical point or not: for every feasible X of the relaxation tr(G X) = tr(Lambda X) - tr((Lambda - G) X)
    <= tr(Lambda) - 3n lambda_min, and tr(Lambda) = tr(G R R^T), so that the cost exceeds the smallest
    possible one by at most 3n max(0, -lambda_min).
    """
    return smallest_eigenpair(problem, rotations)[0]


def certified(problem: Problem, eigenvalue: float) -> bool:
    """Whether a `smallest_eigenvalue` is zero up to what rounding to rotations leaves of it."""
    return eigenvalue >= -ZERO * float(problem.degree.mean())


def smallest_eigenpair(problem: Problem, rotations: Floats) -> tuple[float, Floats]:
    """`smallest_eigenvalue` with its vector, as blocks (n, 3); `rotations` as in `multipliers`."""
    from scipy import sparse
    from scipy.sparse.linalg import eigsh

    measurements = weighted_blocks(problem)
    certificate = certificate_matrix(measurements, multipliers(measurements, rotations))
    size = 3 * problem.n
    start = np.random.default_rng(0).standard_normal((size, 3))
    if size < LARGE:
        found = smallest(certificate, start, 1e-6)
        return float(found.values[0]), found.vectors[:, 0].reshape(-1, 3)
    # The row sums bound the spectrum: the smallest eigenvalue becomes the largest of the shifted matrix, and
    # Lanczos iterations resolve it on the scale of the shift, although it is near zero itself.
    shift = float(abs(certificate).sum(axis=1).max())
    shifted = sparse.diags_array(np.full(size, shift)) - certificate
    largest, vector = eigsh(shifted, k=1, which="LA", v0=start[:, 0], ncv=40, tol=PRECISION, maxiter=5000)
    return float(shift - largest[0]), vector.reshape(-1, 3)
