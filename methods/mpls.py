"""MPLS: message passing least squares."""

from dataclasses import dataclass, replace

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter

from ._lib.descent.cycle_refinement import refined
from ._lib.graph.cemp import ITERATIONS, TRIANGLES, corruption_levels, tree_of_least_corruption
from ._lib.graph.triangles import note_on_missing, sample_triangles
from ._lib.starts import Refined, Start, start_rotations

BETA = 32.0


@method(
    "mpls",
    title="MPLS",
    cite="shi2020",
    requires=("scipy", "numba"),
    robust=True,
    simple_graph=True,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class MPLS(Refined):
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
    a camera; the weights are multiplied by the `confidence` of the edges.

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

    triangles: int = parameter(TRIANGLES, at_least=1)
    init: Start = "cemp-mst"
    iterations: int = parameter(100, at_least=1)
    tolerance_deg: float = parameter(0.05, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        triangles = sample_triangles(problem, self.triangles, rng)
        levels = corruption_levels(triangles, ITERATIONS)
        if self.init == "cemp-mst":
            start = tree_of_least_corruption(problem, levels)
        else:
            start = start_rotations(self.init, problem, rng)

        def by_cycles(residuals: Floats) -> Floats:
            return np.where(triangles.missing, residuals, triangles.weighted_means(np.exp(-BETA * residuals)))

        found = refined(problem, start, levels, by_cycles, self.tolerance_deg, self.iterations)
        return replace(found, notes=note_on_missing(triangles.missing, "their residuals alone weigh them"))
