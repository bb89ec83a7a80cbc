"""MPLS: message passing least squares."""

from dataclasses import dataclass

import numpy as np

from bench.core.problem import Estimate, Floats, Problem
from bench.plugins.declare import method

from . import spectral
from ._lib.graph.cemp import ITERATIONS, TRIANGLES, corruption_levels, tree_of_least_corruption
from ._lib.graph.cycle_refinement import refined
from ._lib.graph.starts import Start, start_rotations
from ._lib.graph.triangles import sample_triangles
from ._lib.linear import laplacian

BETA = 32.0


@method("mpls", title="MPLS", cite="shi2020", requires=("scipy", "numba"), robust=True, deterministic=False)
@dataclass(frozen=True)
class MPLS:
    """Least squares whose weights come from the residuals of edges and, by message passing, of their triangles.

    1. Estimate the corruption s_ij of each edge by CEMP, from up to `triangles` triangles over it (see `CEMP`).
    2. Start from `init`, by default the spanning tree of smallest total s, with weights s^(-3/2).
    3. Weighted least squares in the tangent space; then h_ij = the mean of d_ij,k over the triangles with weights
       exp(-32 (r_ik + r_jk)), r being residuals divided by pi; the new weights are
       (h_ij / (t + 1) + r_ij t / (t + 1))^(-3/2) in iteration t, and the worst edges, up to a fifth, are left out.
       Until the mean step is below the tolerance.

    Source: Shi and Lerman, ICML 2020, algorithm 2, with the settings of its section 4. Deviations: triangles are
    drawn without replacement; h of an edge in no triangle is its residual; weights are kept above 1e-10 of the largest
    (there 1e-8, absolute); residuals are those of the moved cameras, and the mean step is removed instead of anchoring
    a camera. The weights of a problem are not used, except by the spanning-tree start.

    Parameters
    ----------
    triangles
        How many triangles an edge has at most. Where it has more they are drawn at random.
    init
        Where to start, see `start_rotations`. "cemp-mst" uses the s of step 1.
    iterations
        Limit of step 3.
    tolerance_deg
        Mean step at which it ends; the published 0.001 rad is 0.057 degrees.
    """

    triangles: int = TRIANGLES
    init: Start = "cemp-mst"
    iterations: int = 100
    tolerance_deg: float = 0.05

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("triangles", "iterations", "tolerance_deg"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")

    @property
    def exact_to_deg(self) -> float:
        """From a random start only as near as the last step tells."""
        return self.tolerance_deg if self.init == "random" else 1e-6

    @property
    def invariant_to_deg(self) -> float | None:
        """A random start ends in whichever minimum is near."""
        return None if self.init == "random" else 1e-3

    def warm_up(self) -> None:
        """Compile the kernels and load scipy."""
        spectral.compile_and_load()
        laplacian.compile_and_load()
        two_cameras = Problem(2, np.array([[0, 1]], dtype=np.int32), np.eye(3)[None])
        self.solve(two_cameras, np.random.default_rng())

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        triangles = sample_triangles(problem, self.triangles, rng)
        levels = corruption_levels(triangles, ITERATIONS)
        if self.init == "cemp-mst":
            start = tree_of_least_corruption(problem, levels)
        else:
            start = start_rotations(self.init, problem, rng)

        def by_cycles(residuals: Floats) -> Floats:
            return np.where(triangles.missing, residuals, triangles.weighted_means(np.exp(-BETA * residuals)))

        return refined(problem, start, levels, by_cycles, self.tolerance_deg, self.iterations)
