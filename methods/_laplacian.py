"""Weighted graph Laplacian systems, solved many times on one graph."""

from typing import TYPE_CHECKING

import numpy as np

from bench.problem import Floats, Problem

from . import _edge_kernels

if TYPE_CHECKING:
    from scipy import sparse
    from scipy.sparse.linalg import SuperLU

SMALL = 200  # cameras; up to here dense is fastest whatever the density
DENSE_SHARE = 0.1  # of all pairs that are edges; from here on dense is fastest


class LaplacianSolver:
    """Least squares over a graph: the x (n, 3) that minimise sum_ij w_ij |x_i - x_j - b_ij|^2.

    The normal matrix is the weighted graph Laplacian, the same for the three columns: it is factored once for
    each set of weights. The last camera is anchored, and the mean of x is zero. Factors are dense (LAPACK
    ``posv``) or sparse (SuperLU without pivoting, the matrix being positive definite; the ordering that
    reduces fill is found once), whichever was measured to be faster at this size and density.

    Parameters
    ----------
    problem
        A connected problem; only its graph is used.
    """

    def __init__(self, problem: Problem) -> None:
        self._edges = problem.edges
        self._n = problem.n
        self._degrees = np.empty(problem.n)
        self._sums = np.empty((problem.n, 3))
        dense = problem.n <= SMALL or 2 * problem.m > DENSE_SHARE * problem.n**2
        self._system = _DenseSystem(problem) if dense else _SparseSystem(problem)

    def solve(self, weights: Floats, vectors: Floats) -> Floats:
        """Return x (n, 3) for positive `weights` (m,) and `vectors` b (m, 3)."""
        _edge_kernels.divergence(self._edges, weights, vectors, self._degrees, self._sums)
        x = np.zeros((self._n, 3))
        x[:-1] = self._system.solve(weights, self._degrees[:-1], self._sums[:-1])
        x -= x.mean(axis=0)
        return x


class _DenseSystem:
    def __init__(self, problem: Problem) -> None:
        i, j = problem.edges.T
        self._kept = np.flatnonzero(j < problem.n - 1)
        self._size = problem.n - 1
        self._slots = i[self._kept].astype(np.intp) + j[self._kept].astype(np.intp) * self._size
        self._upper = np.zeros((self._size, self._size), order="F")
        self._flat = self._upper.ravel(order="K")

    def solve(self, weights: Floats, degrees: Floats, right: Floats) -> Floats:
        from scipy.linalg import lapack

        self._flat[self._slots] = -weights[self._kept]
        self._flat[:: self._size + 1] = degrees
        _, x, info = lapack.dposv(self._upper, right, lower=0)
        if info != 0:
            raise np.linalg.LinAlgError(f"the Laplacian is not positive definite (row {info})")
        return np.asarray(x)


class _SparseSystem:
    def __init__(self, problem: Problem) -> None:
        from scipy import sparse

        size = problem.n - 1
        i, j = problem.edges.T
        kept = np.flatnonzero(j < size)
        i, j, cameras = i[kept], j[kept], np.arange(size)
        rows, cols = np.concatenate([i, j, cameras]), np.concatenate([j, i, cameras])
        pattern = sparse.csc_array((np.ones(len(rows)), (rows, cols)), shape=(size, size))
        pattern.setdiag(problem.degree[:size] + 1.0)
        place = _factor(pattern, "MMD_AT_PLUS_A").perm_c
        self._order = np.argsort(place)
        entries = np.arange(1.0, len(rows) + 1)
        self._matrix = sparse.csc_array((entries, (place[rows], place[cols])), shape=(size, size))
        self._matrix.sort_indices()
        self._entry = self._matrix.data.astype(np.intp) - 1
        self._kept = kept

    def solve(self, weights: Floats, degrees: Floats, right: Floats) -> Floats:
        off_diagonal = -weights[self._kept]
        self._matrix.data = np.concatenate([off_diagonal, off_diagonal, degrees])[self._entry]
        x = np.empty_like(right)
        x[self._order] = _factor(self._matrix, "NATURAL").solve(right[self._order])
        return x


def _factor(matrix: "sparse.csc_array", ordering: str) -> "SuperLU":
    from scipy.sparse.linalg import splu

    return splu(matrix, permc_spec=ordering, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
