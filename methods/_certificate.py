"""The squared chordal cost and the certificate of its optimum, for every method that minimises it."""

import numpy as np

from bench.problem import Floats, Problem

PRECISION = 1e-10  # of the eigenvalue, relative to the largest one


def chordal_cost(problem: Problem, rotations: Floats) -> float:
    """Sum over the edges of the squared Frobenius norm of R_ij - R_i R_j^T."""
    i, j = problem.edges.T
    difference = problem.rotations - rotations[i] @ np.swapaxes(rotations[j], -1, -2)
    return float(np.sum(difference**2))


def multipliers(problem: Problem, rotations: Floats) -> Floats:
    """Lagrange multipliers (n, 3, 3) of R_i R_i^T = I: the symmetric parts of sum_j R_ij R_j R_i^T."""
    gathered = (problem.block_matrix() @ rotations.reshape(-1, 3)).reshape(-1, 3, 3)
    blocks = gathered @ np.swapaxes(rotations, -1, -2)
    return 0.5 * (blocks + np.swapaxes(blocks, -1, -2))


def smallest_eigenvalue(problem: Problem, rotations: Floats) -> float:
    """Smallest eigenvalue of Lambda - G, the certificate matrix of `chordal_cost` at the rotations.

    Lambda has the `multipliers` on its diagonal, G holds the measurements. At a global optimum the matrix is
    positive semidefinite with R in its kernel (Eriksson et al. 2018). The value bounds the gap anywhere,
    critical point or not: for every feasible X of the relaxation tr(G X) = tr(Lambda X) - tr((Lambda - G) X)
    <= tr(Lambda) - 3n lambda_min, and tr(Lambda) = tr(G R R^T), so that the cost exceeds the smallest
    possible one by at most 3n max(0, -lambda_min).
    """
    from scipy import sparse
    from scipy.sparse.linalg import eigsh

    blocks = sparse.block_diag(list(multipliers(problem, rotations)), format="csr")
    certificate = blocks - problem.block_matrix()
    # The row sums bound the spectrum: the smallest eigenvalue becomes the largest of the shifted matrix, and
    # Lanczos iterations resolve it on the scale of the shift, although it is near zero itself.
    shift = float(abs(certificate).sum(axis=1).max())
    shifted = sparse.diags_array(np.full(3 * problem.n, shift)) - certificate
    start = np.random.default_rng(0).standard_normal(3 * problem.n)
    largest = eigsh(shifted, k=1, which="LA", v0=start, ncv=min(3 * problem.n, 40), tol=PRECISION, maxiter=5000)[0]
    return float(shift - largest[0])
