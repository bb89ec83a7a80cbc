"""The three smallest eigenvalues of a sparse symmetric matrix of blocks of three, with their vectors."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from bench.core.problem import Floats

from .eigenspace import BLOCK, leading_eigenspace

if TYPE_CHECKING:
    from scipy import sparse

SMALL = 300  # rows; up to here LAPACK solves the full problem fastest
DENSE = 1200  # rows; up to here a dense factorization is fastest
DENSE_SHARE = 0.1  # of all entries; from here on a dense factorization is faster than a sparse one
FACTORED = 4000  # rows; beyond, only matrices of narrow bandwidth are factored
NARROW = 0.2  # bandwidth over rows
SHIFT = 1e-3  # first shift, relative to the mean of the diagonal
ANGLE = 1e-6  # radians between the vectors found and the true ones; values are good to the square of it

Solve = Callable[[Floats], Floats]


def smallest_eigenspace(matrix: "sparse.csr_array", start: Floats) -> tuple[Floats, Floats]:
    """Values (3,), ascending, and orthonormal vectors (N, 3).

    Small matrices go to LAPACK. Otherwise Lanczos iterations find the largest eigenvalues, of the inverse
    where a factorization is cheap, of the negative where it is not. The matrix is shifted until its Cholesky
    factorization exists, which proves that its smallest eigenvalues are the largest of the inverse.

    Parameters
    ----------
    matrix
        (N, N), with a positive mean of the diagonal.
    start
        (N, 3) of full rank; it should have a part in every direction, because an iteration that starts in an
        invariant subspace never leaves it.
    """
    from scipy.linalg import eigh

    size = matrix.shape[0]
    if size <= SMALL:
        values, vectors = eigh(matrix.toarray(), subset_by_index=[0, BLOCK - 1])
        return values, vectors
    if size <= FACTORED or _bandwidth(matrix) < NARROW * size:
        dense = size <= DENSE or matrix.nnz > DENSE_SHARE * size**2
        multiply = _inverse(matrix, _cholesky if dense else _sparse_cholesky)
    else:
        bound = float(abs(matrix).sum(axis=1).max())

        def multiply(x: Floats) -> Floats:
            return bound * x - matrix @ x

    basis = leading_eigenspace(multiply, start, ANGLE).vectors
    values, turn = np.linalg.eigh(basis.T @ (matrix @ basis))
    return values, basis @ turn


def _inverse(matrix: "sparse.csr_array", factored: Callable[["sparse.csr_array", float], Solve | None]) -> Solve:
    shift = SHIFT * float(matrix.diagonal().mean())
    while (solve := factored(matrix, shift)) is None:
        shift *= 10
    return solve


def _cholesky(matrix: "sparse.csr_array", shift: float) -> Solve | None:
    from scipy.linalg import cho_factor, cho_solve

    shifted = matrix.toarray(order="F")
    np.einsum("ii->i", shifted)[:] += shift
    try:
        factor = cho_factor(shifted, check_finite=False, overwrite_a=True)
    except np.linalg.LinAlgError:
        return None
    return lambda x: cho_solve(factor, x, check_finite=False)


def _sparse_cholesky(matrix: "sparse.csr_array", shift: float) -> Solve | None:
    """SuperLU without pivoting: U has the pivots of L D L^T on its diagonal, all positive if the matrix is."""
    from scipy import sparse
    from scipy.sparse.linalg import splu

    shifted = (matrix + sparse.diags_array(np.full(matrix.shape[0], shift))).tocsc()
    try:
        factor = splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # a pivot is exactly zero
        return None
    if (factor.perm_r != factor.perm_c).any() or factor.U.diagonal().min() <= 0:
        return None
    return lambda x: factor.solve(np.ascontiguousarray(x))


def _bandwidth(matrix: "sparse.csr_array") -> int:
    """Largest distance from the diagonal in the reverse Cuthill-McKee numbering."""
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    position = np.empty(matrix.shape[0], dtype=np.intp)
    position[reverse_cuthill_mckee(matrix, symmetric_mode=True)] = np.arange(matrix.shape[0])
    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    return int(np.abs(position[rows] - position[matrix.indices]).max())
