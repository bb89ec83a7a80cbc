"""Graduated non-convexity: a robust cost reached through costs that are easier to minimise."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter

from ._lib.descent.iterate import Iterate, floored, mean_norm
from ._lib.descent.surrogates import SURROGATES, GncLoss
from ._lib.graph.confidence import confidence
from ._lib.linear.laplacian import LaplacianSolver
from ._lib.starts import Start, Started, start_rotations

LEAST_SQUARES_STEPS = 20  # at most, from the start


@method("gnc", title="GNC", cite="yang2020", requires=("scipy", "numba"), robust=True, uses=("weights", "precisions"))
@dataclass(frozen=True)
class GNC(Started):
    """Minimises sum_ij c_ij loss(angle(R_i R_j^T, R_ij)), the loss being truncated least squares or Geman-McClure.

    The c_ij are the `confidence` of the edges.

    1. From `init` go to the least-squares solution over all edges.
    2. Choose mu from the largest residual, such that the surrogate of the cost is nearly convex.
    3. Compute the weights w_ij of the surrogate at the residuals.
    4. Minimise sum_ij c_ij w_ij |log(R_i^T R_ij R_j)|^2: repeatedly solve x_i - x_j = b_ij with those weights (a
       weighted graph Laplacian) and move R_i <- R_i exp(x_i).
    5. Change mu by a factor of 1.4 and go to 3. Stop when the surrogate is the cost (mu is 1 for
       Geman-McClure, all weights are 0 or 1 for truncated least squares) and the first step of 4 is below
       the tolerance.

    Source: Yang, Antonante, Tzoumas and Carlone, RA-L 2020, algorithm 1, propositions 3 and 4, remark 5.
    Deviations: step 4, a global solver in the paper, is local, starts from the last rotations and does at
    most `inner_iterations`; the sum of the weighted squares is compared only where mu has arrived or all
    weights are 0 or 1; weights are kept above 1e-10 of the largest, so that the graph stays connected.

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
    threshold_deg: float = parameter(5.0, above=0)
    init: Start = "auto"
    iterations: int = parameter(100, at_least=0)
    inner_iterations: int = parameter(1, at_least=1)
    tolerance_deg: float = parameter(1e-2, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        surrogate, laplacian = SURROGATES[self.loss], LaplacianSolver(problem)
        start = Iterate.at(problem, start_rotations(self.init, problem, rng))
        trust = confidence(problem)
        weights = np.ones(problem.m)
        here, _ = self._settled(start, trust, laplacian, LEAST_SQUARES_STEPS)
        x = (here.angles / np.radians(self.threshold_deg)) ** 2
        mu = surrogate.first(float(x.max()))
        reason, done = "iteration limit", 0
        while done < self.iterations:
            weights = surrogate.weight(x, mu)
            here, step = self._settled(here, trust * weights, laplacian, self.inner_iterations)
            x = (here.angles / np.radians(self.threshold_deg)) ** 2
            done += 1
            if step < np.radians(self.tolerance_deg) and surrogate.arrived(mu, weights):
                reason = f"mean step below {self.tolerance_deg:g} degrees on the robust cost"
                break
            mu = surrogate.following(mu)
        cost = float((trust * surrogate.cost(x)).sum())
        return Estimate(here.rotations, edge_weights=trust * weights, iterations=done, stop_reason=reason, cost=cost)

    def _settled(self, here: Iterate, weights: Floats, laplacian: LaplacianSolver, limit: int) -> tuple[Iterate, float]:
        """Where least squares with `weights` (m,) leads to from `here`, and the mean of the first steps."""
        lengths: list[float] = []
        while len(lengths) < limit and (not lengths or lengths[-1] >= np.radians(self.tolerance_deg)):
            steps = laplacian.solve(floored(weights), here.vectors)
            here = here.turned(steps)
            lengths.append(mean_norm(steps))
        return here, lengths[0]
