"""Levenberg-Marquardt on a robust cost: the continuous refinement of discrete-continuous optimization."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter

from ._lib.descent.iterate import Iterate, floored, mean_norm
from ._lib.descent.losses import LOSSES, LossName
from ._lib.graph.confidence import confidence
from ._lib.linear.laplacian import LaplacianSolver
from ._lib.starts import Start, Started, start_rotations

FIRST_DAMPING, SMALLEST_DAMPING, LARGEST_DAMPING = 1e-3, 1e-8, 1e8  # of the weight of the edges of each camera


@method(
    "robust-lm",
    title="Robust LM",
    cite="crandall2011",
    requires=("scipy", "numba"),
    robust=True,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class RobustLM(Started):
    """Minimises sum_ij c_ij loss(angle(R_i R_j^T, R_ij)) by damped steps that never raise it.

    The c_ij are the `confidence` of the edges.

    1. Start from `init`.
    2. With b_ij = log(R_i^T R_ij R_j) and w_ij = c_ij loss'(|b_ij|) / |b_ij|, minimise over x the sum of
       w_ij |x_i - x_j - b_ij|^2 and of damping d_i |x_i|^2, d_i being the sum of the weights of camera i:
       one factorization of a weighted Laplacian plus a diagonal.
    3. Move R_i <- R_i exp(x_i) if that lowers the cost, and set the damping from the ratio of the decrease
       to the one that the quadratic model promised (Nielsen 1999); otherwise raise the damping.
    4. Repeat until the mean step is below the tolerance.

    Unlike `l1-irls` there is no L1 stage: the answer is the local minimum of one cost that the start leads
    to.

    Source: Crandall, Owens, Snavely and Huttenlocher, CVPR 2011: the continuous refinement. Deviations: what
    precedes it there, discrete belief propagation, is replaced by `init`; the derivative of log is taken as
    the identity, which leaves the gradient exact, decouples the three coordinates and never underestimates
    the curvature; a truncated quadratic is ``talwar``.

    Parameters
    ----------
    loss, sigma_deg
        The loss and the scale of the noise, as in `l1-irls`.
    init
        Where to start, see `start_rotations`.
    iterations
        Largest number of factorizations.
    tolerance_deg
        Mean step at which it ends.
    """

    loss: LossName = "geman-mcclure"
    sigma_deg: float = parameter(5.0, above=0)
    init: Start = "auto"
    iterations: int = parameter(200, at_least=0)
    tolerance_deg: float = parameter(1e-3, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        loss, scale = LOSSES[self.loss], LOSSES[self.loss].scale(np.radians(self.sigma_deg))
        system = _DampedSystem(problem)
        here = Iterate.at(problem, start_rotations(self.init, problem, rng))
        trust = confidence(problem)
        cost = float((trust * loss.value(here.angles / scale)).sum())
        damping, raise_by = FIRST_DAMPING, 2.0
        reason, done = "iteration limit", 0
        while done < self.iterations:
            weights = floored(trust * loss.weight(here.angles / scale))
            steps, promised = system.solve(weights, damping, here.vectors / scale)
            steps *= scale
            there = here.turned(steps)
            there_cost = float((trust * loss.value(there.angles / scale)).sum())
            done += 1
            if there_cost < cost:
                ratio = (cost - there_cost) / promised
                damping = max(damping * max(1 / 3, 1 - (2 * ratio - 1) ** 3), SMALLEST_DAMPING)
                here, cost, raise_by = there, there_cost, 2.0
            elif damping < LARGEST_DAMPING:
                damping, raise_by = damping * raise_by, 2 * raise_by
            else:
                reason = "no step lowers the cost"
                break
            if mean_norm(steps) < np.radians(self.tolerance_deg):
                reason = f"mean step below {self.tolerance_deg:g} degrees"
                break
        return Estimate(
            here.rotations,
            edge_weights=trust * loss.weight(here.angles / scale),
            iterations=done,
            stop_reason=reason,
            cost=cost,
        )


class _DampedSystem:
    """Damped least squares over a graph: the damping is an edge from every camera to one that stands still.

    That camera is the last of a larger graph, which `LaplacianSolver` anchors and leaves out of its matrix.
    """

    def __init__(self, problem: Problem) -> None:
        self._edges = problem.edges
        cameras = np.arange(problem.n, dtype=np.int32)
        ground = np.stack([cameras, np.full_like(cameras, problem.n)], axis=1)
        edges = np.concatenate([problem.edges, ground])
        self._laplacian = LaplacianSolver(Problem(problem.n + 1, edges, np.tile(np.eye(3), (len(edges), 1, 1))))

    def solve(self, weights: Floats, damping: float, vectors: Floats) -> tuple[Floats, float]:
        """Steps (n, 3), and by how much the undamped sum of weights times squares over 2 decreases."""
        degrees = np.bincount(self._edges.ravel(), np.repeat(weights, 2))
        all_weights = np.concatenate([weights, damping * degrees])
        all_vectors = np.concatenate([vectors, np.zeros((len(degrees), 3))])
        x = self._laplacian.solve(all_weights, all_vectors)
        x = x[:-1] - x[-1]
        left = vectors - x[self._edges[:, 0]] + x[self._edges[:, 1]]
        return x, float(weights @ (vectors**2 - left**2).sum(axis=1)) / 2
