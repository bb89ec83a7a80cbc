"""The three leading eigenvectors of a large symmetric matrix that is known only by its products."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bench.core.problem import Floats

BLOCK = 3
LARGEST_BASIS = 20  # blocks, before a restart
KEPT = 5  # blocks of Ritz vectors that survive a restart
CHECKED_EVERY = 3  # products
ROUNDING = 4 * np.finfo(float).eps


@dataclass(frozen=True)
class Eigenspace:
    """What `leading_eigenspace` found.

    Parameters
    ----------
    vectors
        (N, 3), orthonormal.
    error
        Bound on the largest angle to the true subspace, radians, as far as the gap to the rest is known.
    products
        How many products with three columns it took.
    """

    vectors: Floats
    error: float
    products: int


def leading_eigenspace(
    multiply: Callable[[Floats], Floats], start: Floats, tolerance: float, most_products: int = 2000
) -> Eigenspace:
    """Block Lanczos iteration with full reorthogonalisation and thick restarts (Wu and Simon 2000).

    A block of three finds the triple eigenvalue of a noise-free problem, of which a single vector (ARPACK)
    sees one copy until rounding brings in the others; and it can start from an estimate of all three.

    Parameters
    ----------
    multiply
        Product of the symmetric matrix with (N, 3) columns; N at least 60.
    start
        (N, 3), of full rank.
    tolerance
        Ends when the residual, divided by the gap between the third and the fourth Ritz value, is below this
        (Davis and Kahan: an angle in radians), or when the residual is rounding error.
    most_products
        Ends at the first check (every third product) after so many products.
    """
    size = BLOCK * LARGEST_BASIS
    basis = np.empty((len(start), size), order="F")
    projected = np.zeros((size, size))
    basis[:, :BLOCK] = np.linalg.qr(start)[0]
    used, products = BLOCK, 0
    while True:
        newest = slice(used - BLOCK, used)
        image = multiply(basis[:, newest])
        products += 1
        following, coupling = _orthogonalised(image, basis[:, :used], projected[:used, newest])
        projected[newest, :used] = projected[:used, newest].T
        full = used == size
        invariant = np.abs(coupling).max() <= ROUNDING * np.abs(projected[:used, newest]).max()
        if full or invariant or products % CHECKED_EVERY == 0:
            values, ritz = np.linalg.eigh(projected[:used, :used])
            residual = float(np.linalg.norm(coupling @ ritz[newest, -BLOCK:], 2))
            error = residual / _gap(values)
            rounding = invariant or residual <= ROUNDING * abs(values[-1])
            if error <= tolerance or rounding or products >= most_products:
                return Eigenspace(basis[:, :used] @ ritz[:, -BLOCK:], error, products)
        if full:
            used = BLOCK * KEPT
            basis[:, :used] = basis @ ritz[:, -used:]
            projected[:used, :used] = np.diag(values[-used:])
        basis[:, used : used + BLOCK] = following
        used += BLOCK


def _orthogonalised(image: Floats, basis: Floats, coefficients: Floats) -> tuple[Floats, Floats]:
    """Split `image` into basis @ coefficients (filled) and the rest: its directions, and its triangle."""
    coefficients[:] = basis.T @ image
    following, coupling = np.linalg.qr(image - basis @ coefficients)
    for _ in range(2):  # where a column was zero, only rounding is left after the first pass
        following, _ = np.linalg.qr(following - basis @ (basis.T @ following))
    return following, coupling


def dense_eigenspace(matrix: Floats) -> Eigenspace:
    """Find the same of a small symmetric matrix (N, N), N >= 6, with LAPACK."""
    from scipy.linalg import eigh

    size = len(matrix)
    values, vectors = eigh(matrix, subset_by_index=[size - BLOCK - 1, size - 1])
    return Eigenspace(vectors[:, 1:], ROUNDING * abs(values[-1]) / _gap(values), 0)


def _gap(values: Floats) -> float:
    """Distance from the third largest Ritz value to the fourth, or to zero where there are three."""
    fourth = values[-BLOCK - 1] if len(values) > BLOCK else 0.0
    return max(float(values[-BLOCK] - fourth), np.finfo(float).tiny)
