"""Averaging in the Lie algebra: geodesic least squares by repeated linearisation."""

from dataclasses import dataclass

import numpy as np

from bench.core.problem import Estimate, Problem
from bench.plugins.declare import method

from . import spectral
from ._lib.descent.iterate import Iterate, mean_norm
from ._lib.graph.starts import Start, Started, start_rotations
from ._lib.linear.laplacian import LaplacianSolver


@method("lie-averaging", title="Lie-algebraic averaging", cite="govindu2004", requires=("scipy", "numba"))
@dataclass(frozen=True)
class LieAveraging(Started):
    """Minimises sum_ij angle(R_i R_j^T, R_ij)^2, the squares of geodesic distances.

    1. Start from `init`.
    2. Solve x_i - x_j = log(R_i^T R_ij R_j) over all edges in the least-squares sense, and move
       R_i <- R_i exp(x_i).
    3. Repeat 2 until the mean step is below the tolerance.

    The cost has local minima: with many outliers the answer depends on the start, by 0.7 degrees of median
    on Madrid Metropolis.

    Source: Govindu, CVPR 2004, section 4. Deviations: the mean step is removed instead of anchoring the first
    camera; the paper names no start. The weights of a problem are used by the spanning-tree start alone.

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
    iterations: int = 100
    tolerance_deg: float = 1e-3

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.iterations < 0:
            raise ValueError(f"iterations must not be negative, not {self.iterations}")
        if not self.tolerance_deg > 0:
            raise ValueError(f"tolerance_deg must be positive, not {self.tolerance_deg:g}")

    def warm_up(self) -> None:
        """Compile the kernels and load scipy."""
        spectral.compile_and_load()
        two_cameras = Problem(2, np.array([[0, 1]], dtype=np.int32), np.eye(3)[None])
        self.solve(two_cameras, np.random.default_rng())

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        here = Iterate.at(problem, start_rotations(self.init, problem, rng))
        laplacian, ones = LaplacianSolver(problem), np.ones(problem.m)
        reason, done = "iteration limit", 0
        while done < self.iterations:
            steps = laplacian.solve(ones, here.vectors)
            here = here.turned(steps)
            done += 1
            if mean_norm(steps) < np.radians(self.tolerance_deg):
                reason = f"mean step below {self.tolerance_deg:g} degrees"
                break
        return Estimate(here.rotations, iterations=done, stop_reason=reason, cost=float(here.angles @ here.angles))
