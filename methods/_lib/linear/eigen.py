"""A few eigenvectors at one end of the spectrum of a symmetric matrix: `leading`, `smallest`.

Eigenvalues come in threes and fours here (every gauge of one answer has the same), so that all iterate on a block, and
small matrices are decomposed in full: LAPACK's drivers that select a few eigenpairs return fewer than asked for where
eigenvalues coincide.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bench import Floats, Ints

if TYPE_CHECKING:
    from scipy import sparse

Product = Callable[[Floats], Floats]  # of a symmetric matrix (N, N), or of its inverse, with columns (N, c)

PRECISE = 1e-9  # radians between the space found and the true one
SMALL = 300  # rows; up to here LAPACK solves the full problem fastest
NARROW = 0.2  # bandwidth over cameras, below which sparse factors are cheap
LARGEST_BASIS = 20  # blocks, before a restart
KEPT = 5  # blocks of Ritz vectors that survive a restart
CHECKED_EVERY = 3  # products
ROUNDING = 4 * float(np.finfo(float).eps)
LOST = 1e-13  # of a direction; what is left of it outside a space is rounding

SHIFT, SHIFT_GROWTH = 1e-10, 1000.0  # first shift, relative to the mean of the diagonal, and its factor
SMALLEST_DIAGONAL = 1e-3  # relative to its mean, in place of smaller entries under a fraction


@dataclass(frozen=True)
class Eigenspace:
    """What `leading` and `smallest` find.

    Parameters
    ----------
    values
        (c,) ascending.
    vectors
        (N, c), orthonormal.
    error
        Bound on the largest angle to the true subspace, radians, as far as the gap to the rest is known.
    products
        How many products with c columns it took.
    """

    values: Floats
    vectors: Floats
    error: float
    products: int


def leading(multiply: Product, start: Floats, tolerance: float = PRECISE, most_products: int = 2000) -> Eigenspace:
    """Eigenvectors of the largest eigenvalues of a matrix that is known only by its products.

    Block Lanczos iteration with full reorthogonalisation and thick restarts (Wu and Simon 2000). A block of three
    finds the triple eigenvalue of a noise-free problem, of which a single vector (ARPACK) sees one copy until rounding
    brings in the others; and it can start from an estimate of all three.

    Parameters
    ----------
    multiply
        Product of the matrix with (N, c) columns; N at least 20 c.
    start
        (N, c), of full rank; c eigenvectors are sought.
    tolerance
        Ends when the residual, divided by the gap to the next Ritz value, is below this (Davis and Kahan: an angle in
        radians), or when the residual is rounding error.
    most_products
        Ends at the first check (every third product) after so many products.
    """
    block = start.shape[1]
    size = block * LARGEST_BASIS
    basis = np.empty((len(start), size), order="F")
    projected = np.zeros((size, size))
    basis[:, :block] = np.linalg.qr(start)[0]
    used, products = block, 0
    while True:
        newest = slice(used - block, used)
        image = multiply(basis[:, newest])
        products += 1
        following, coupling = _orthogonalised(image, basis[:, :used], projected[:used, newest])
        projected[newest, :used] = projected[:used, newest].T
        full = used == size
        invariant = np.abs(coupling).max() <= ROUNDING * np.abs(projected[:used, newest]).max()
        if full or invariant or products % CHECKED_EVERY == 0:
            values, ritz = np.linalg.eigh(projected[:used, :used])
            residual = float(np.linalg.norm(coupling @ ritz[newest, -block:], 2))
            error = residual / _gap(-values[::-1], block)
            rounding = invariant or residual <= ROUNDING * abs(values[-1])
            if error <= tolerance or rounding or products >= most_products:
                return Eigenspace(values[-block:], basis[:, :used] @ ritz[:, -block:], error, products)
        if full:
            used = block * KEPT
            basis[:, :used] = basis @ ritz[:, -used:]
            projected[:used, :used] = np.diag(values[-used:])
        basis[:, used : used + block] = following
        used += block


def smallest(
    matrix: "sparse.bsr_array", start: Floats, tolerance: float = PRECISE, most_products: int = 600
) -> Eigenspace:
    """Eigenvectors of the smallest eigenvalues of a sparse matrix, which need not be positive.

    Small matrices go to LAPACK. Otherwise block Davidson iterations with thick restarts (Davidson 1975; Crouzeix,
    Philippe and Sadkane 1994): the basis grows by the preconditioned residuals of the Ritz vectors of the smallest Ritz
    values. What preconditions is the shifted matrix itself where it can be factored cheaply (rings, trajectories,
    grids), on any other graph its diagonal.

    Parameters
    ----------
    matrix
        (N, N), with a positive mean of the diagonal, and one block for each pair of cameras.
    start
        (N, c) of full rank; c eigenvectors are sought. It should have a part in every direction, because an iteration
        that starts in an invariant subspace never leaves it.
    tolerance, most_products
        As in `leading`.
    """
    size, block = start.shape
    if size <= SMALL:
        return smallest_of_dense(matrix.toarray(), block)
    precondition = _preconditioner(matrix)
    basis, images = (np.empty((size, LARGEST_BASIS * block), order="F") for _ in range(2))
    largest = float(abs(matrix).sum(axis=1).max())
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
            if error <= tolerance or norm <= ROUNDING * largest or products >= most_products:
                return Eigenspace(values[:block], vectors, error, products)
        if used + block > basis.shape[1]:
            kept = KEPT * block
            basis[:, :kept] = basis[:, :used] @ ritz[:, :kept]
            images[:, :kept] = images[:, :used] @ ritz[:, :kept]
            used = kept
        new = _beyond(np.linalg.qr(precondition(residuals))[0], basis[:, :used])


def leading_of_dense(matrix: Floats, count: int) -> Eigenspace:
    """Find the eigenvectors of the `count` largest eigenvalues of a matrix (N, N) with LAPACK."""
    values, vectors = np.linalg.eigh(matrix)
    error = ROUNDING * abs(float(values[-1])) / _gap(-values[::-1], count)
    return Eigenspace(values[-count:], vectors[:, -count:], error, 0)


def smallest_of_dense(matrix: Floats, count: int) -> Eigenspace:
    """Find the eigenvectors of the `count` smallest eigenvalues of a matrix (N, N) with LAPACK."""
    values, vectors = np.linalg.eigh(matrix)
    error = ROUNDING * abs(float(values[-1])) / _gap(values, count)
    return Eigenspace(values[:count], vectors[:, :count], error, 0)


def narrow(graph: "sparse.csr_array", share: float = NARROW) -> bool:
    """Whether the cameras of a symmetric matrix (n, n) can be numbered so that factors are cheap.

    By the largest distance from the diagonal in the reverse Cuthill-McKee numbering, below `share` of n.
    """
    return within_band(graph, share * graph.shape[0]) is not None


def within_band(graph: "sparse.csr_array", most: float) -> Ints | None:
    """The reverse Cuthill-McKee numbering of a symmetric matrix (n, n): the camera (n,) at each place.

    None where an entry is `most` places or more away from the diagonal.
    """
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    n = graph.shape[0]
    degrees = np.diff(graph.indptr)
    if degrees.max() >= 2 * most:  # the bandwidth is at least half of it
        return None
    order = reverse_cuthill_mckee(graph, symmetric_mode=True)
    position = np.empty(n, dtype=np.int32)
    position[order] = np.arange(n, dtype=np.int32)
    farthest = np.abs(position[np.repeat(np.arange(n), degrees)] - position[graph.indices]).max()
    return order if farthest < most else None


def sparse_factors(matrix: "sparse.csr_array") -> "Product | None":
    """Inverse of a positive definite matrix by SuperLU without pivoting; None where it is not positive definite.

    U has the pivots of L D L^T on its diagonal, all positive if the matrix is.
    """
    from scipy.sparse.linalg import splu

    try:
        factor = splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError:  # a pivot is exactly zero
        return None
    if (factor.perm_r != factor.perm_c).any() or factor.U.diagonal().min() <= 0:
        return None
    return lambda x: factor.solve(np.ascontiguousarray(x))


def _orthogonalised(image: Floats, basis: Floats, coefficients: Floats) -> tuple[Floats, Floats]:
    """Split `image` (N, c) into basis @ coefficients (filled) and the rest: its directions, and its triangle (c, c)."""
    coefficients[:] = basis.T @ image
    following, coupling = np.linalg.qr(image - basis @ coefficients)
    return _beyond(following, basis), coupling


def _beyond(directions: Floats, basis: Floats) -> Floats:
    """The orthonormal `directions` (N, c), turned out of the span of `basis` (N, k).

    Where nothing but rounding lies outside, a random direction takes the place: rounding can stay in the span however
    often it is projected out, as on graphs whose cameras are all alike.
    """
    rng = np.random.default_rng(basis.shape[1])
    for _ in range(2):
        rest = directions - basis @ (basis.T @ directions)
        lost = np.linalg.norm(rest, axis=0) <= LOST
        if lost.any():
            random = rng.standard_normal((len(basis), int(lost.sum())))
            rest[:, lost] = random - basis @ (basis.T @ random)
        directions = np.linalg.qr(rest)[0]
    return directions


def _gap(values: Floats, block: int) -> float:
    """Distance from the last of the `block` smallest values (k,) to the next, or to zero where there is none."""
    following = float(values[block]) if len(values) > block else 0.0
    return max(following - float(values[block - 1]), float(np.finfo(float).tiny))


def _preconditioner(matrix: "sparse.bsr_array") -> Product:
    """Product with the inverse of the shifted matrix where its bandwidth is small, else with that of its diagonal.

    The shift grows until the factorization exists, so that the preconditioner is positive definite whatever the matrix
    is.
    """
    from scipy import sparse

    size, diagonal = matrix.shape[0], matrix.diagonal()
    mean = float(diagonal.mean())
    if not narrow(sparse.csr_array((np.ones(len(matrix.indices)), matrix.indices, matrix.indptr))):
        inverse = 1 / np.maximum(diagonal, SMALLEST_DIAGONAL * mean)[:, None]
        return lambda x: inverse * x
    rows, shift = matrix.tocsr(), SHIFT * mean
    while (solve := sparse_factors(rows + sparse.diags_array(np.full(size, shift)))) is None:
        shift *= SHIFT_GROWTH
    return solve
