"""Spectral synchronization: the three leading eigenvectors of the block matrix of the measurements."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bench.core import so3
from bench.core.problem import Estimate, Floats, Problem
from bench.plugins.declare import method

from ._lib.linear.eigenspace import Eigenspace, dense_eigenspace, leading_eigenspace
from ._lib.loops import edge_kernels
from .spanning_tree import hub, tree_rotations

SMALL = 100  # cameras; up to here LAPACK solves the full problem fastest
NARROW = 0.2  # bandwidth over cameras, below which the shifted matrix is factored
POWER_STEPS = 30
SHIFT = 1e-8  # relative distance of the shift from the upper bound on the eigenvalues
PRECISE = 1e-9  # radians


@method("spectral", title="Spectral", cite="arienachimson2012", requires=("scipy", "numba"))
@dataclass(frozen=True)
class Spectral:
    """Maximises sum_ij trace(R_i^T R_ij R_j) with the constraint relaxed to orthonormal columns.

    1. G holds R_ij in block (i, j), its transpose in block (j, i) and identities on the diagonal; with
       `normalised` it becomes D^(-1/2) G D^(-1/2), where D is the degree plus one.
    2. Take its three algebraically largest eigenvectors, cut them into one block for each camera and, when
       most blocks are reflections, change the sign of one eigenvector: the reflection is one for all
       cameras.
    3. Replace every block by the nearest rotation.

    Sources: Singer 2011 (for SO(2), normalised), Arie-Nachimson et al. 2012, section 4 (for SO(3)).
    Deviations: none in what is computed; D^(-1/2) is not applied to the eigenvectors, because a positive
    factor does not move the nearest rotation. How the eigenvectors are found follows from the graph (see
    `spectral_rotations`). The weights of a problem are not used.

    Parameters
    ----------
    normalised
        Whether to divide by the degrees. Without, the eigenvectors concentrate on cameras with many
        measurements; where degrees differ much (trajectories that cross) the blocks of the others sink
        below rounding.
    """

    normalised: bool = True

    def warm_up(self) -> None:
        """Compile the kernel and load scipy."""
        compile_and_load()

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        rotations, found = spectral_rotations(problem, normalised=self.normalised)
        if found.error <= PRECISE:
            return Estimate(rotations, iterations=found.products, stop_reason="eigenvectors converged")
        note = f"the eigenvectors are known to {np.degrees(found.error):.1e} degrees only: the gap is too small"
        return Estimate(rotations, iterations=found.products, stop_reason="eigenvectors not separated", notes=(note,))


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
    blocks = found.vectors.reshape(-1, 3, 3)
    if np.sign(np.linalg.det(blocks)).sum() < 0:
        blocks = blocks * [1.0, 1.0, -1.0]
    return so3.project(blocks), found


def compile_and_load() -> None:
    """Compile the kernel and load what is used of scipy, on a complete graph and on a chain."""
    n = SMALL + 1
    complete = np.stack(np.triu_indices(n, 1), axis=1, dtype=np.int32)
    chain = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1, dtype=np.int32)
    for edges in (complete, chain):
        spectral_rotations(Problem(n, edges, np.tile(np.eye(3), (len(edges), 1, 1))))


def _eigenspace(problem: Problem, weights: Floats, diagonal: Floats, scale: Floats, tolerance: float) -> Eigenspace:
    if problem.n <= SMALL:
        return dense_eigenspace(problem.block_matrix(weights, diagonal).toarray())
    highest = problem.degree.max()  # the bandwidth is at least half of it
    if highest < 2 * NARROW * problem.n and bandwidth(problem) < NARROW * problem.n:
        start = (tree_rotations(problem) / scale[:, None, None]).reshape(-1, 3)
        return leading_eigenspace(_inverse(problem, weights, diagonal, start), start, tolerance)

    def multiply(x: Floats) -> Floats:
        product = np.empty((problem.n, 3, 3))
        blocks = np.ascontiguousarray(x).reshape(-1, 3, 3)
        edge_kernels.block_product(problem.edges, problem.rotations, weights, diagonal, blocks, product)
        return product.reshape(-1, 3)

    start = _neighbourhood(problem) / scale[:, None, None]
    return leading_eigenspace(multiply, start.reshape(-1, 3), tolerance)


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


def bandwidth(problem: Problem) -> int:
    """Largest distance between the ends of an edge in the reverse Cuthill-McKee numbering."""
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    position = np.empty(problem.n, dtype=np.intp)
    position[reverse_cuthill_mckee(problem.adjacency(), symmetric_mode=True)] = np.arange(problem.n)
    return int(np.abs(np.diff(position[problem.edges], axis=1)).max())


def _inverse(problem: Problem, weights: Floats, diagonal: Floats, start: Floats) -> Callable[[Floats], Floats]:
    """Products with the inverse of (shift - G), the shift being an upper bound on the eigenvalues of G.

    The blocks of G are rotations times positive weights, so that its eigenvalues are at most those of the
    matrix of the weights, which max_i (A x)_i / x_i bounds for any positive x (Collatz); power iterations
    bring the bound down.
    """
    from scipy import sparse
    from scipy.sparse.linalg import splu

    magnitude = problem.adjacency(weights) + sparse.diags_array(diagonal)
    x = np.linalg.norm(start.reshape(-1, 9), axis=1)
    for _ in range(POWER_STEPS):
        image = magnitude @ x
        bound = (image / x).max()
        x = image / image.max()
    shifted = -problem.block_matrix(weights, diagonal - (1 + SHIFT) * bound)
    factor = splu(shifted.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return lambda x: factor.solve(np.ascontiguousarray(x))
