"""The few smallest eigenvectors of graph Laplacians whose edges carry matrices."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from bench.core.problem import Floats, Problem

from ...spectral import NARROW, PRECISE, SMALL, bandwidth
from .eigenspace import ROUNDING, Eigenspace

if TYPE_CHECKING:
    from scipy import sparse

SHIFT = 1e-10  # of the factored matrix, relative to its largest diagonal entry
LARGEST_BASIS = 20  # blocks, before a restart
KEPT = 4  # blocks of Ritz vectors that survive a restart
MOST_PRODUCTS = 600


def block_laplacian(problem: Problem, blocks: Floats) -> "sparse.bsr_array":
    """Matrix (k n, k n) of the sum over the edges of |x_i - B_ij x_j|^2, for orthogonal `blocks` B_ij (m, k, k).

    It has the degrees times the identity on the diagonal, -B_ij in block (i, j) and -B_ij^T in block (j, i).
    """
    from scipy import sparse

    n, k = problem.n, blocks.shape[-1]
    i, j = problem.edges.T
    rows, cols = np.concatenate([i, j, np.arange(n)]), np.concatenate([j, i, np.arange(n)])
    order = np.lexsort((cols, rows))
    starts = np.searchsorted(rows[order], np.arange(n + 1))
    diagonal = problem.degree[:, None, None] * np.eye(k)
    data = np.concatenate([-blocks, -np.swapaxes(blocks, -1, -2), diagonal])[order]
    return sparse.bsr_array((data, cols[order], starts), shape=(k * n, k * n))


def smallest_eigenspace(
    problem: Problem, laplacian: "sparse.bsr_array", start: Floats, tolerance: float = PRECISE
) -> Eigenspace:
    """Find the eigenvectors of the smallest eigenvalues of a `block_laplacian`.

    Up to 100 cameras LAPACK is called. Otherwise block Davidson iterations, preconditioned by the factors of
    the shifted matrix where the cameras can be numbered so that its bandwidth is small against their number
    (rings, trajectories, grids), and by its diagonal on any other graph.

    Parameters
    ----------
    problem
        A connected problem; only its graph is used.
    laplacian
        (k n, k n).
    start
        (k n, c), of full rank; c eigenvectors are sought.
    tolerance
        Angle between the subspaces found and sought, in radians, at which the iteration ends.
    """
    if problem.n <= SMALL:
        return _by_lapack(laplacian.toarray(), start.shape[1])
    if bandwidth(problem) < NARROW * problem.n:
        return davidson(laplacian, _factors(laplacian), start, tolerance)
    inverse = 1 / laplacian.diagonal()[:, None]
    return davidson(laplacian, lambda x: inverse * x, start, tolerance)


def davidson(
    matrix: "sparse.bsr_array",
    precondition: Callable[[Floats], Floats],
    start: Floats,
    tolerance: float,
    most_products: int = MOST_PRODUCTS,
) -> Eigenspace:
    """Block Davidson iteration with thick restarts (Davidson 1975; Crouzeix, Philippe and Sadkane 1994).

    The basis grows by the preconditioned residuals of the Ritz vectors of the smallest Ritz values. Ends when
    their norm, divided by the gap to the next Ritz value, is below `tolerance` (Davis and Kahan: an angle in
    radians), when it is rounding error, or after `most_products` products.
    """
    block = start.shape[1]
    basis, images = (np.empty((len(start), LARGEST_BASIS * block), order="F") for _ in range(2))
    size = abs(matrix).sum(axis=1).max()
    new, used, products = np.linalg.qr(start)[0], 0, 0
    while True:
        basis[:, used : used + block] = new
        images[:, used : used + block] = matrix @ new
        used, products = used + block, products + 1
        values, ritz = np.linalg.eigh(basis[:, :used].T @ images[:, :used])
        vectors = basis[:, :used] @ ritz[:, :block]
        residuals = images[:, :used] @ ritz[:, :block] - vectors * values[:block]
        norm = float(np.linalg.norm(residuals))
        if used > block:  # before, the gap is not known
            error = norm / _gap(values, block)
            if error <= tolerance or norm <= ROUNDING * size or products >= most_products:
                return Eigenspace(vectors, error, products)
        if used + block > basis.shape[1]:
            kept = KEPT * block
            basis[:, :kept] = basis[:, :used] @ ritz[:, :kept]
            images[:, :kept] = images[:, :used] @ ritz[:, :kept]
            used = kept
        new = precondition(residuals)
        for _ in range(2):
            new = np.linalg.qr(new - basis[:, :used] @ (basis[:, :used].T @ new))[0]


def _by_lapack(matrix: Floats, block: int) -> Eigenspace:
    values, vectors = np.linalg.eigh(matrix)
    return Eigenspace(vectors[:, :block], ROUNDING * float(values[-1]) / _gap(values, block), 0)


def _gap(values: Floats, block: int) -> float:
    return max(float(values[block] - values[block - 1]), np.finfo(float).eps)


def _factors(matrix: "sparse.bsr_array") -> Callable[[Floats], Floats]:
    from scipy import sparse
    from scipy.sparse.linalg import splu

    shift = SHIFT * matrix.diagonal().max()
    shifted = matrix + sparse.diags_array(np.full(matrix.shape[0], shift))
    factors = splu(shifted.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return lambda x: factors.solve(np.ascontiguousarray(x))
