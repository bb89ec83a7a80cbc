"""Graduated non-convexity: a robust cost reached through costs that are easier to minimise."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench.core.problem import Estimate, Floats, Problem
from bench.plugins.declare import method

from . import spectral
from ._lib.descent.iterate import Iterate, floored, mean_norm
from ._lib.graph.starts import Start, Started, start_rotations
from ._lib.linear.laplacian import LaplacianSolver

FACTOR = 1.4  # by which the surrogate approaches the cost, as published
BINARY = 1e-4  # weights this close to 0 or 1 are 0 or 1, as in GTSAM
LEAST_SQUARES_STEPS = 20  # at most, from the start
LARGEST_FIRST = 1e6  # mu, where no residual is large enough to be doubted

GncLoss = Literal["tls", "geman-mcclure"]


@dataclass(frozen=True)
class Surrogate:
    """A family of costs that leads from a nearly convex one to a robust one.

    Its functions take x = (residual / threshold)^2 (m,) and the control parameter mu.

    Parameters
    ----------
    cost
        The robust cost of each edge.
    weight
        Weights (m,) of the squared residuals, in [0, 1].
    first, following
        mu for the largest x; the mu after a mu.
    arrived
        Whether the surrogate with this mu, and with the weights that it gave, is the robust cost.
    """

    cost: Callable[[Floats], Floats]
    weight: Callable[[Floats, float], Floats]
    first: Callable[[float], float]
    following: Callable[[float], float]
    arrived: Callable[[float, Floats], bool]


def tls_weight(x: Floats, mu: float) -> Floats:
    """Weights: 1 up to x = mu / (mu + 1), 0 from (mu + 1) / mu, between them sqrt(mu (mu + 1) / x) - mu."""
    x = np.maximum(x, mu / (mu + 1))
    # The difference of two numbers that grow with mu, written as one fraction.
    return np.maximum((mu + mu**2 * (1 - x)) / (x * (np.sqrt(mu * (mu + 1) / x) + mu)), 0.0)


SURROGATES: dict[GncLoss, Surrogate] = {
    "tls": Surrogate(
        cost=lambda x: np.minimum(x, 1.0),
        weight=tls_weight,
        first=lambda largest: 1 / max(2 * largest - 1, 1 / LARGEST_FIRST),
        following=lambda mu: mu * FACTOR,
        arrived=lambda mu, weights: bool((np.minimum(weights, 1 - weights) < BINARY).all()),
    ),
    "geman-mcclure": Surrogate(
        cost=lambda x: x / (1 + x),
        weight=lambda x, mu: (mu / (mu + x)) ** 2,
        first=lambda largest: max(2 * largest, 1.0),
        following=lambda mu: max(mu / FACTOR, 1.0),
        arrived=lambda mu, weights: mu == 1,
    ),
}


@method("gnc", title="GNC", cite="yang2020", requires=("scipy", "numba"), robust=True)
@dataclass(frozen=True)
class GNC(Started):
    """Minimises sum_ij loss(angle(R_i R_j^T, R_ij)), the loss being truncated least squares or Geman-McClure.

    1. From `init` go to the least-squares solution over all edges.
    2. Choose mu from the largest residual, such that the surrogate of the cost is nearly convex.
    3. Compute the weights w_ij of the surrogate at the residuals.
    4. Minimise sum_ij w_ij |log(R_i^T R_ij R_j)|^2: repeatedly solve x_i - x_j = b_ij with those weights (a
       weighted graph Laplacian) and move R_i <- R_i exp(x_i).
    5. Change mu by a factor of 1.4 and go to 3. Stop when the surrogate is the cost (mu is 1 for
       Geman-McClure, all weights are 0 or 1 for truncated least squares) and the first step of 4 is below
       the tolerance.

    Source: Yang, Antonante, Tzoumas and Carlone, RA-L 2020, algorithm 1, propositions 3 and 4, remark 5.
    Deviations: step 4, a global solver in the paper, is local, starts from the last rotations and does at
    most `inner_iterations`; the sum of the weighted squares is compared only where mu has arrived or all
    weights are 0 or 1; weights are kept above 1e-10 of the largest, so that the graph stays connected. The
    weights of a problem are used by the spanning-tree start alone.

    Parameters
    ----------
    loss
        ``tls`` (truncated least squares) or ``geman-mcclure``.
    threshold_deg
        The largest residual of an inlier: where the truncated loss becomes constant, the scale of
        Geman-McClure.
    init
        Where to start, see `start_rotations`.
    iterations
        Largest number of values of mu.
    inner_iterations
        Largest number of linearisations for one mu.
    tolerance_deg
        Mean step at which one mu is done with.
    """

    loss: GncLoss = "tls"
    threshold_deg: float = 5.0
    init: Start = "spectral"
    iterations: int = 100
    inner_iterations: int = 1
    tolerance_deg: float = 1e-2

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("threshold_deg", "tolerance_deg"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name):g}")
        if self.iterations < 0:
            raise ValueError(f"iterations must not be negative, not {self.iterations}")
        if self.inner_iterations < 1:
            raise ValueError(f"inner_iterations must be positive, not {self.inner_iterations}")

    def warm_up(self) -> None:
        """Compile the kernels and load scipy."""
        spectral.compile_and_load()
        two_cameras = Problem(2, np.array([[0, 1]], dtype=np.int32), np.eye(3)[None])
        self.solve(two_cameras, np.random.default_rng())

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        surrogate, laplacian = SURROGATES[self.loss], LaplacianSolver(problem)
        start = Iterate.at(problem, start_rotations(self.init, problem, rng))
        weights = np.ones(problem.m)
        here, _ = self._settled(start, weights, laplacian, LEAST_SQUARES_STEPS)
        x = (here.angles / np.radians(self.threshold_deg)) ** 2
        mu = surrogate.first(float(x.max()))
        reason, done = "iteration limit", 0
        while done < self.iterations:
            weights = surrogate.weight(x, mu)
            here, step = self._settled(here, weights, laplacian, self.inner_iterations)
            x = (here.angles / np.radians(self.threshold_deg)) ** 2
            done += 1
            if step < np.radians(self.tolerance_deg) and surrogate.arrived(mu, weights):
                reason = f"mean step below {self.tolerance_deg:g} degrees on the robust cost"
                break
            mu = surrogate.following(mu)
        cost = float(surrogate.cost(x).sum())
        return Estimate(here.rotations, edge_weights=weights, iterations=done, stop_reason=reason, cost=cost)

    def _settled(self, here: Iterate, weights: Floats, laplacian: LaplacianSolver, limit: int) -> tuple[Iterate, float]:
        """Where weighted least squares leads to from `here`, and the mean of the first steps."""
        lengths: list[float] = []
        while len(lengths) < limit and (not lengths or lengths[-1] >= np.radians(self.tolerance_deg)):
            steps = laplacian.solve(floored(weights), here.vectors)
            here = here.turned(steps)
            lengths.append(mean_norm(steps))
        return here, lengths[0]
