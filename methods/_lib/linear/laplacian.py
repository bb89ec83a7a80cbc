"""Graph Laplacians: those whose edges carry matrices, and weighted systems solved many times on one graph."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

import numpy as np

from bench import Floats, Ints, Problem

from ..graph.confidence import confidence, strengths
from ..loops import edge_kernels
from ..loops.edge_kernels import Singles
from .eigen import narrow, within_band

if TYPE_CHECKING:
    from scipy import sparse
    from scipy.sparse.linalg import SuperLU

SMALL = 200  # cameras; up to here dense factors are fastest whatever the density
DENSE_SHARE = 0.1  # of all pairs that are edges; from here on dense factors are fastest
LARGE = 500  # cameras; from here on conjugate gradients are fastest where the graph is well connected
WELL_CONNECTED = 20  # edges at a camera, on average
SEQUENCE = 0.02  # bandwidth over cameras, below which factors are cheap and conjugate gradients slow
BAND = 12  # bandwidth over edges at a camera, below which factors that are dense in the band are fastest
SMALLEST = np.finfo(np.float32).tiny  # in place of zero, under a fraction
MOST_PRODUCTS = 500  # of conjugate gradients in one system, before it is factored instead


def block_laplacian(problem: Problem, blocks: Floats) -> "sparse.bsr_array":
    """Matrix (k n, k n) of the sum over the edges of w_ij |x_i - B_ij x_j|^2, for orthogonal `blocks` B_ij (m, k, k).

    w is the `confidence`. Block (i, i) is the sum of the w of camera i times the identity, block (i, j) is -w_ij B_ij,
    block (j, i) its transpose.
    """
    from scipy import sparse

    n, k = problem.n, blocks.shape[-1]
    i, j = problem.edges.T
    rows, cols = np.concatenate([i, j, np.arange(n)]), np.concatenate([j, i, np.arange(n)])
    order = np.lexsort((cols, rows))
    starts = np.searchsorted(rows[order], np.arange(n + 1))
    diagonal = strengths(problem)[:, None, None] * np.eye(k)
    blocks = confidence(problem)[:, None, None] * blocks
    data = np.concatenate([-blocks, -np.swapaxes(blocks, -1, -2), diagonal])[order]
    matrix = sparse.bsr_array((data, cols[order], starts), shape=(k * n, k * n))
    matrix.sum_duplicates()
    return matrix


class LaplacianSolver:
    """Least squares over a graph: the x (n, 3) that minimise sum_ij w_ij |x_i - x_j - b_ij|^2.

    The normal matrix is the weighted graph Laplacian, the same for the three columns: it is factored once for
    each set of weights. The last camera is anchored, and the mean of x is zero. Factors are dense (LAPACK
    ``posv``), dense within a band (``pbtrf``, along sequences) or sparse (SuperLU without pivoting, the matrix being
    positive definite; the ordering that reduces fill is found once), whichever was measured to be fastest at this
    size, density and bandwidth.

    Where an approximation will do, large graphs with many edges at a camera are not factored, except long sequences:
    conjugate gradients, preconditioned by the diagonal, single precision. A system that takes them too long is
    factored after all, and so is every later one.

    Parameters
    ----------
    problem
        A connected problem; only its graph is used.
    tolerance
        Residual that is allowed, relative to the right-hand side, in the norm that the inverse of the
        diagonal gives; zero for factors always.
    """

    def __init__(self, problem: Problem, tolerance: float = 0.0) -> None:
        self._problem = problem
        self._degrees = np.empty(problem.n)
        self._sums = np.empty((problem.n, 3))
        well_connected = problem.n >= LARGE and 2 * problem.m >= WELL_CONNECTED * problem.n
        iterative = tolerance > 0 and well_connected and not narrow(problem.adjacency(), SEQUENCE)
        self._tolerance = tolerance if iterative else 0.0
        self._factored = _factored(problem) if self._tolerance == 0 else None

    def solve(self, weights: Floats, vectors: Floats) -> Floats:
        """Return x (n, 3) for positive `weights` (m,) and `vectors` b (m, 3)."""
        edge_kernels.divergence(self._problem.edges, weights, vectors, self._degrees, self._sums)
        x = np.zeros((self._problem.n, 3))
        if self._factored is None:
            if _conjugate_gradients(self._problem.edges, weights, self._degrees, self._sums, self._tolerance, x):
                return x
            self._factored = _factored(self._problem)
        x[:-1] = self._factored.solve(weights, self._degrees, self._sums[:-1])
        x[-1] = 0
        x -= x.mean(axis=0)
        return x

    def inverse(self, weights: Floats) -> Callable[[Floats], Floats]:
        """Return the map from right-hand sides (n, k), whose columns sum to zero, to the x (n, k) of mean zero.

        The normal matrix of `weights` (m,) is factored once, however often the map is used.
        """
        n = self._problem.n
        i, j = self._problem.edges.T
        degrees = np.asarray(np.bincount(i, weights, n) + np.bincount(j, weights, n))
        if self._factored is None:
            return lambda right: self._approximate(weights, degrees, right)
        within = self._factored.factor(weights, degrees)

        def solved(right: Floats) -> Floats:
            x = np.zeros(right.shape)
            x[:-1] = within(right[:-1])
            return np.asarray(x - x.mean(axis=0))

        return solved

    def _approximate(self, weights: Floats, degrees: Floats, right: Floats) -> Floats:
        """As the map of `inverse`, three columns at a time."""
        result = np.empty(right.shape)
        for first in range(0, right.shape[1], 3):
            columns = right[:, first : first + 3]
            padded, x = np.zeros((len(right), 3)), np.zeros((len(right), 3))
            padded[:, : columns.shape[1]] = columns
            if not _conjugate_gradients(self._problem.edges, weights, degrees, padded, self._tolerance, x):
                self._factored = _factored(self._problem)
                return self.inverse(weights)(right)
            result[:, first : first + 3] = x[:, : columns.shape[1]]
        return result


def _conjugate_gradients(
    edges: Ints, weights: Floats, degrees: Floats, right: Floats, tolerance: float, x: Floats
) -> bool:
    """Fill x (n, 3), of mean zero; whether the residual fell below `tolerance` in time."""
    w, diagonal, inverse = (a.astype(np.float32) for a in (weights, degrees, 1 / degrees[:, None]))
    residual = np.zeros((len(x), 4), np.float32)  # three columns, and one of zeros that fills the registers
    residual[:, :3] = right
    solution, image = np.zeros_like(residual), np.empty_like(residual)
    conditioned = inverse * residual
    direction = conditioned.copy()
    energy = first = _dots(residual, conditioned)
    for _ in range(MOST_PRODUCTS):
        edge_kernels.laplacian_product(edges, w, diagonal, direction, image)
        length = energy / np.maximum(_dots(direction, image), SMALLEST)
        solution += length * direction
        residual -= length * image
        np.multiply(inverse, residual, out=conditioned)
        before, energy = energy, _dots(residual, conditioned)
        if np.all(energy <= tolerance**2 * first):
            x[:] = solution[:, :3]
            x -= x.mean(axis=0)
            return True
        direction *= energy / np.maximum(before, SMALLEST)
        direction += conditioned
    return False


def _dots(a: Singles, b: Singles) -> Singles:
    """Scalar products (4,) of the columns of a and b (n, 4)."""
    products: Singles = np.einsum("nk,nk->k", a, b)
    return products


def compile_and_load() -> None:
    """Compile the kernels that only large graphs need, on two cameras."""
    problem = Problem(2, np.array([[0, 1]], dtype=np.int32), np.eye(3)[None])
    one, zeros = np.ones(2), np.zeros((2, 3))
    _conjugate_gradients(problem.edges, one[:1], one, zeros, 1.0, zeros)
    _BandedSystem(problem, np.arange(2, dtype=np.int32)).solve(one[:1], one, zeros[:1])


def _factored(problem: Problem) -> "_DenseSystem | _BandedSystem | _SparseSystem":
    if problem.n <= SMALL or 2 * problem.m > DENSE_SHARE * problem.n**2:
        return _DenseSystem(problem)
    order = within_band(problem.adjacency(), BAND * 2 * problem.m / problem.n)
    return _SparseSystem(problem) if order is None else _BandedSystem(problem, order)


class _DenseSystem:
    """`solve` takes weights (m,), their sums (n,) and right-hand sides (n - 1, 3), and returns x (n - 1, 3).

    `factor` takes the first two, and returns the map from right-hand sides (n - 1, k) to x (n - 1, k).
    """

    def __init__(self, problem: Problem) -> None:
        self._edges = problem.edges
        self._rows = np.empty((problem.n - 1, problem.n - 1))

    def solve(self, weights: Floats, degrees: Floats, right: Floats) -> Floats:
        from scipy.linalg import lapack

        edge_kernels.dense_laplacian(self._edges, weights, degrees, self._rows)
        _, x, info = lapack.dposv(self._rows.T, right, lower=1, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError(f"the Laplacian is not positive definite (row {info})")
        return np.asarray(x)

    def factor(self, weights: Floats, degrees: Floats) -> Callable[[Floats], Floats]:
        from scipy.linalg import lapack

        rows = np.empty_like(self._rows)
        edge_kernels.dense_laplacian(self._edges, weights, degrees, rows)
        factor, info = lapack.dpotrf(rows.T, lower=1, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError(f"the Laplacian is not positive definite (row {info})")
        return lambda right: np.asarray(lapack.dpotrs(factor, right, lower=1)[0])


class _BandedSystem:
    """As `_DenseSystem`, for cameras in an `order` (n,) in which those of an edge stand close together."""

    def __init__(self, problem: Problem, order: Ints) -> None:
        size = problem.n - 1
        self._order = order[order != size]
        position = np.full(problem.n, -1, dtype=np.int32)  # the last camera is anchored
        position[self._order] = np.arange(size, dtype=np.int32)
        self._places = position[problem.edges]
        inside = self._places.min(axis=1) >= 0
        self._width = 1 + int(np.ptp(self._places[inside], axis=1).max(initial=0))

    def solve(self, weights: Floats, degrees: Floats, right: Floats) -> Floats:
        return self.factor(weights, degrees)(right)

    def factor(self, weights: Floats, degrees: Floats) -> Callable[[Floats], Floats]:
        from scipy.linalg import lapack

        rows = np.zeros((len(self._order), self._width))
        edge_kernels.banded_laplacian(self._places, weights, degrees[self._order], rows)
        factor, info = lapack.dpbtrf(rows.T, lower=1, overwrite_ab=1)
        if info != 0:
            raise np.linalg.LinAlgError(f"the Laplacian is not positive definite (row {info})")

        def solved(right: Floats) -> Floats:
            x = np.empty_like(right)
            x[self._order] = lapack.dpbtrs(factor, right[self._order], lower=1)[0]
            return x

        return solved


class _SparseSystem:
    """As `_DenseSystem`."""

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
        column_by_column, self._entry = np.unique(place[cols] * np.int64(size) + place[rows], return_inverse=True)
        starts = np.searchsorted(column_by_column, np.arange(size + 1) * np.int64(size))
        entries = np.empty(len(column_by_column))
        self._matrix = sparse.csc_array((entries, column_by_column % size, starts), shape=(size, size))
        self._kept = kept

    def solve(self, weights: Floats, degrees: Floats, right: Floats) -> Floats:
        return self.factor(weights, degrees)(right)

    def factor(self, weights: Floats, degrees: Floats) -> Callable[[Floats], Floats]:
        off_diagonal = -weights[self._kept]
        values = np.concatenate([off_diagonal, off_diagonal, degrees[:-1]])
        self._matrix.data = np.asarray(np.bincount(self._entry, values), dtype=np.float64)  # parallel edges add up
        factor = _factor(self._matrix, "NATURAL")

        def solved(right: Floats) -> Floats:
            x = np.empty_like(right)
            x[self._order] = factor.solve(right[self._order])
            return x

        return solved


def _factor(matrix: "sparse.csc_array[np.float64]", ordering: Literal["MMD_AT_PLUS_A", "NATURAL"]) -> "SuperLU":
    from scipy.sparse.linalg import splu

    return splu(matrix, permc_spec=ordering, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
