"""A Riemannian trust region on a staircase of ranks."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter

from ._lib.graph.confidence import strengths
from ._lib.linear.certificate import (
    certified,
    chordal_cost,
    smallest_eigenpair,
    smallest_eigenvalue,
    weighted_blocks,
)
from ._lib.linear.rounding import nearest_rotations
from ._lib.starts import Seeded, Start, start_rotations

FIRST_STEP = 1.0  # radians, about, at the camera that moves most, when the staircase escapes
SHORTEST_STEP = 1e-6


@method(
    "staircase",
    title="Riemannian staircase",
    cite="boumal2016",
    requires=("pymanopt", "scipy", "numba"),
    certifies=True,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class Staircase(Seeded):
    """Minimises the sum of squared chordal residuals over Y_i (3, p) with orthonormal rows, from p = 3 upward.

    1. Start from the rotations of `init`: p = 3.
    2. Minimise -tr(Y^T G Y) / 2, where G holds R_ij in block (i, j), by the Riemannian trust region method
       with truncated conjugate gradients, preconditioned by the degrees, on the product of Stiefel manifolds.
    3. The smallest eigenvalue of Lambda - G, Lambda_i the symmetric part of sum_j R_ij Y_j Y_i^T, tells
       whether the critical point is the global minimum. If it is not and p < p_max, append a column of zeros,
       step along the eigenvector in that column, halving the step until the cost falls, and go to 2 with p + 1.
    4. Round: the three leading right singular vectors of Y (3n, p), every block replaced by the nearest
       rotation.

    Sources: Boumal, Voroninski and Bandeira 2016 and Boumal 2015 (the staircase), Rosen et al. 2019, SE-Sync
    (the escape, the rounding); the trust region method is pymanopt's, with its defaults, the polar
    retraction, and the gradient and Hessian given by hand. Deviations: the first p is 3, SE-Sync's 5; SE-Sync's
    preconditioner is a factorization. The certificate of the estimate belongs to the rounded rotations. The
    terms are weighted by the `confidence` of the edges, and so are G and the degrees.

    Parameters
    ----------
    init
        Where to start, see `start_rotations`.
    p_max
        Where the staircase ends.
    tolerance
        Norm of the gradient at which a trust region run ends, and how far below zero the smallest eigenvalue
        of an accepted point may be; both relative to the mean degree.
    max_iterations
        Of the trust region method, for each p.
    """

    init: Start = "spectral"
    p_max: int = parameter(10, at_least=3)
    tolerance: float = parameter(1e-8, above=0)
    max_iterations: int = parameter(500, at_least=1)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        points, iterations = start_rotations(self.init, problem, rng), 0
        threshold = self.tolerance * float(problem.degree.mean())
        while True:
            points, done = self._minimised(problem, points, threshold)
            iterations += done
            smallest, direction = smallest_eigenpair(problem, points)
            p = points.shape[2]
            if smallest >= -threshold or p >= self.p_max:
                break
            points = _escaped(problem, points, direction)
        rotations = _rounded(points)
        certificate = smallest_eigenvalue(problem, rotations)
        reason, notes = f"critical point at p = p_max = {p}", tuple[str, ...]()
        if smallest < -threshold:
            notes = (f"not certified up to p={p}; the smallest eigenvalue is {smallest:.1e}",)
        elif certified(problem, certificate):
            reason = f"certified at p = {p}"
        else:
            reason = f"optimum of the relaxation at p = {p}"
            notes = (f"not certified: rounding from p = {p} leaves a smallest eigenvalue of {certificate:.1e}",)
        return Estimate(
            rotations,
            iterations=iterations,
            stop_reason=reason,
            cost=chordal_cost(problem, rotations),
            certificate=certificate,
            notes=notes,
        )

    def _minimised(self, problem: Problem, points: Floats, gradient_norm: float) -> tuple[Floats, int]:
        """Critical point (n, 3, p) that the trust region method finds from `points`, and its iterations."""
        import pymanopt
        from pymanopt.manifolds import Stiefel
        from pymanopt.optimizers import TrustRegions

        n, _, p = points.shape
        manifold = Stiefel(p, 3, k=n, retraction="polar")
        measurements, degree = weighted_blocks(problem), strengths(problem)[:, None, None]

        def product(x: Floats) -> Floats:
            """G Y (n, p, 3); pymanopt's points are the transposes Y_i^T (p, 3)."""
            return _transposed((measurements @ _transposed(x).reshape(-1, p)).reshape(n, 3, p))

        def cost(x: Floats) -> Any:
            return -0.5 * np.vdot(x, product(x))

        def gradient(x: Floats) -> Floats:
            return -product(x)

        def hessian(x: Floats, direction: Floats) -> Floats:
            return -product(direction)

        declared = pymanopt.function.numpy(manifold)
        model = pymanopt.Problem(
            manifold,
            declared(cost),
            euclidean_gradient=declared(gradient),
            euclidean_hessian=declared(hessian),
            preconditioner=lambda _, vector: vector / degree,
        )
        start = _transposed(points)
        if np.linalg.norm(model.riemannian_gradient(start)) < gradient_norm:
            return points, 0  # pymanopt divides by the norm of the first gradient
        optimizer = TrustRegions(
            verbosity=0, max_time=np.inf, max_iterations=self.max_iterations, min_gradient_norm=gradient_norm
        )
        found = optimizer.run(model, initial_point=start)
        return _transposed(found.point), int(found.iterations)


def _escaped(problem: Problem, points: Floats, direction: Floats) -> Floats:
    """Points (n, 3, p + 1) of lower cost, from a critical point (n, 3, p) along `direction` (n, 3)."""
    lifted = np.concatenate([points, np.zeros((problem.n, 3, 1))], axis=2)
    before = chordal_cost(problem, points)
    step = FIRST_STEP / np.abs(direction).max()
    while step * np.abs(direction).max() > SHORTEST_STEP:
        lifted[:, :, -1] = step * direction
        moved = _orthonormal(lifted)
        if chordal_cost(problem, moved) < before:
            return moved
        step /= 2
    return moved


def _orthonormal(points: Floats) -> Floats:
    """The nearest points (n, 3, p) with orthonormal rows."""
    left, _, right = np.linalg.svd(points, full_matrices=False)
    return left @ right


def _rounded(points: Floats) -> Floats:
    """Rotations (n, 3, 3) from points (n, 3, p), by their three leading right singular vectors."""
    _, _, right = np.linalg.svd(points.reshape(-1, points.shape[2]), full_matrices=False)
    return nearest_rotations(points.reshape(-1, points.shape[2]) @ right[:3].T)


def _transposed(x: Floats) -> Floats:
    """From (n, 3, p) to (n, p, 3) and back, in consecutive memory."""
    return np.ascontiguousarray(np.swapaxes(x, 1, 2))
