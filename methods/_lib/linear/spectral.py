"""Rotations from the three leading eigenvectors of the block matrix of the measurements."""

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Problem

from ..graph.trees import hub, tree_rotations
from ..loops import edge_kernels
from .eigen import PRECISE, SMALL, Eigenspace, Product, leading, leading_of_dense, narrow, sparse_factors
from .rounding import nearest_rotations

POWER_STEPS = 30
SHIFT = 1e-8  # relative distance of the shift from the upper bound on the eigenvalues
SMALLEST_WEIGHT = 1e-4


def spectral_rotations(
    problem: Problem,
    edge_weights: Floats | None = None,
    *,
    normalised: bool = True,
    regularisation: float = 0.0,
    tolerance: float = PRECISE,
) -> tuple[Floats, Eigenspace]:
    """Rotations (n, 3, 3) by the steps of `Spectral`, the block of each edge multiplied by its weight.

    Up to 100 cameras LAPACK is called. A graph whose cameras can be numbered so that its bandwidth is small
    against their number (rings, trajectories, grids: reverse Cuthill-McKee tells) has a small spectral gap
    and a cheap factorization: Lanczos iterations on the inverse of the shifted matrix. Any other graph
    mixes fast, and Lanczos iterations on the matrix itself converge; it is never formed. They start from a
    spanning tree and from the neighbours of the camera of highest degree, so that the result does not depend
    on a random vector.

    Parameters
    ----------
    problem
        A connected problem.
    edge_weights
        (m,) positive, by default ones. The diagonal block of each camera gets their mean over its edges when
        `normalised` (a larger one would cut off a camera whose edges all weigh little), else the largest of all.
    normalised
        As in `Spectral`, D being the sum of the weights of a camera, its diagonal block included.
    regularisation
        How many times the mean of D is added to D. With outliers the leading eigenvectors tend to settle on a
        few cameras of low degree at the rim of a large graph; this holds them in its middle (Chaudhuri, Chung
        and Tsiatas 2012, for spectral clustering).
    tolerance
        Angle between the subspaces found and sought, in radians, at which the iteration ends.
    """
    weights = np.ones(problem.m) if edge_weights is None else np.ascontiguousarray(edge_weights)
    diagonal = np.full(problem.n, weights.max())
    scale = np.ones(problem.n)
    if normalised:
        sums = np.bincount(problem.edges.ravel(), np.repeat(weights, 2))
        diagonal = sums / problem.degree
        scale = 1 / np.sqrt(diagonal + sums + regularisation * (diagonal + sums).mean())
        weights = weights * scale[problem.edges].prod(axis=1)
        diagonal = diagonal * scale**2
    found = _eigenspace(problem, weights, diagonal, scale, tolerance)
    return nearest_rotations(found.vectors), found


def weighted_spectral(problem: Problem, weights: Floats, alone: NDArray[np.bool_]) -> Floats:
    """Rotations (n, 3, 3) of CEMP+GCW: the spectral solution with `weights` (m,), normalised by those of each camera.

    Edges `alone` (m,), in no triangle, get the median weight of the others: of them nothing is known, and where two
    parts of a graph hang together by such edges only, a weight of exp(-beta) would let the eigenvectors choose one
    part. For the same reason no weight is below 1e-4.
    """
    usual = 1.0 if alone.all() else np.median(weights[~alone])
    return spectral_rotations(problem, np.maximum(np.where(alone, usual, weights), SMALLEST_WEIGHT))[0]


def _eigenspace(problem: Problem, weights: Floats, diagonal: Floats, scale: Floats, tolerance: float) -> Eigenspace:
    """The three leading eigenvectors (3n, 3): `weights` (m,) times the blocks, `diagonal` (n,), both scaled (n,)."""
    if 3 * problem.n <= SMALL:
        return leading_of_dense(problem.block_matrix(weights, diagonal).toarray(), 3)
    if narrow(problem.adjacency()):
        start = (tree_rotations(problem) / scale[:, None, None]).reshape(-1, 3)
        return leading(_inverse(problem, weights, diagonal, start), start, tolerance)

    def multiply(x: Floats) -> Floats:
        product = np.empty((problem.n, 3, 3))
        blocks = np.ascontiguousarray(x).reshape(-1, 3, 3)
        edge_kernels.block_product(problem.edges, problem.rotations, weights, diagonal, blocks, product)
        return product.reshape(-1, 3)

    start = _neighbourhood(problem) / scale[:, None, None]
    return leading(multiply, start.reshape(-1, 3), tolerance)


def _neighbourhood(problem: Problem) -> Floats:
    """Rotations (n, 3, 3) of the camera of highest degree and of its neighbours, as measured; zeros elsewhere."""
    centre = hub(problem)
    i, j = problem.edges.T
    out, back = np.flatnonzero(i == centre), np.flatnonzero(j == centre)
    rotations = np.zeros((problem.n, 3, 3))
    rotations[centre] = np.eye(3)
    rotations[j[out]] = np.swapaxes(problem.rotations[out], -1, -2)
    rotations[i[back]] = problem.rotations[back]
    return rotations


def _inverse(problem: Problem, weights: Floats, diagonal: Floats, start: Floats) -> Product:
    """Products with the inverse of (shift - G), the shift being an upper bound on the eigenvalues of G.

    The blocks of G are rotations times positive `weights` (m,), with `diagonal` (n,) times identities, so that its
    eigenvalues are at most those of the matrix of the weights, which max_i (A x)_i / x_i bounds for any positive x
    (Collatz); power iterations from the norms of the blocks of `start` (3n, 3) bring the bound down.
    """
    from scipy import sparse

    magnitude = problem.adjacency(weights) + sparse.diags_array(diagonal)
    x = np.linalg.norm(start.reshape(-1, 9), axis=1)
    for _ in range(POWER_STEPS):
        image = magnitude @ x
        bound = (image / x).max()
        x = image / image.max()
    shift = SHIFT
    while (solve := sparse_factors(-problem.block_matrix(weights, diagonal - (1 + shift) * bound))) is None:
        shift *= 10  # rounding
    return solve
