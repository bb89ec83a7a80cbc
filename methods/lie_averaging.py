"""Averaging in the Lie algebra: geodesic least squares by repeated linearisation."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Problem, method, parameter

from ._lib.descent.iterate import Iterate, mean_norm
from ._lib.graph.confidence import confidence
from ._lib.linear.laplacian import LaplacianSolver
from ._lib.starts import Start, Started, start_rotations


@method(
    "lie-averaging",
    title="Lie-algebraic averaging",
    cite="govindu2004",
    requires=("scipy", "numba"),
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class LieAveraging(Started):
    """Minimises sum_ij w_ij angle(R_i R_j^T, R_ij)^2, w being the `confidence` of the edges.

    1. Start from `init`.
    2. Solve x_i - x_j = log(R_i^T R_ij R_j) over all edges in the weighted least-squares sense, and move
       R_i <- R_i exp(x_i).
    3. Repeat 2 until the mean step is below the tolerance.

    The cost has local minima: with many outliers the answer depends on the start, by 0.7 degrees of median
    on Madrid Metropolis.

    Source: Govindu, CVPR 2004, section 4. Deviations: the mean step is removed instead of anchoring the first
    camera; the paper names no start; the weights.

    Parameters
    ----------
    init
        Where to start, see `start_rotations`.
    iterations
        Largest number of linearisations.
    tolerance_deg
        Mean step at which it ends.
    """

    init: Start = "spanning-tree"
    iterations: int = parameter(100, at_least=0)
    tolerance_deg: float = parameter(1e-3, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        here = Iterate.at(problem, start_rotations(self.init, problem, rng))
        laplacian, weights = LaplacianSolver(problem), confidence(problem)
        reason, done = "iteration limit", 0
        while done < self.iterations:
            steps = laplacian.solve(weights, here.vectors)
            here = here.turned(steps)
            done += 1
            if mean_norm(steps) < np.radians(self.tolerance_deg):
                reason = f"mean step below {self.tolerance_deg:g} degrees"
                break
        return Estimate(
            here.rotations, iterations=done, stop_reason=reason, cost=float((weights * here.angles) @ here.angles)
        )
