"""DESC: corruption levels by quadratic programming over triangles."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter

from ._lib.descent.cycle_refinement import refined
from ._lib.descent.simplex_descent import consistent_levels
from ._lib.graph.cemp import inlier_weights
from ._lib.graph.triangles import codegrees, note_on_missing, sample_triangles
from ._lib.linear.spectral import weighted_spectral
from ._lib.starts import Refined, Start, start_rotations

FEWEST_TRIANGLES = 30


@method(
    "desc",
    title="DESC",
    cite="shi2022",
    requires=("scipy", "numba"),
    robust=True,
    simple_graph=True,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class DESC(Refined):
    """Minimises sum_ij sum_k w_ij,k (s_ik + s_jk), with s_ij = sum_k w_ij,k d_ij,k, for the corruption s of the edges.

    1. Take up to `triangles` triangles over each edge and their inconsistencies d_ij,k, the angle of R_ij R_jk R_ki
       divided by pi. The w_ij,k >= 0 of an edge sum to one; they start equal.
    2. `descent_iterations` steps of projected gradient descent on the objective. An edge in no triangle keeps s = 1.
    3. Start from `init`, by default the spectral solution with each block weighted by exp(-32 s_ij), as in `CEMP`.
    4. Weighted least squares in the tangent space, first with weights s^(-3/2), then
       (s_ij / (t + 1) + r_ij t / (t + 1))^(-3/2) in iteration t, r being residuals divided by pi; the worst edges, up
       to a fifth, are left out. Until the mean step is below the tolerance.

    Source: Shi, Wyeth and Lerman, ICML 2022 (the quadratic program; the refinement is that of the authors' code).
    Deviations: the gradient counts every triangle sampled over any edge (theirs only those sampled over both edges in
    question), and the descent makes all its steps (theirs may stop when the objective stalls); an edge in no triangle
    counts with the median weight in step 3 and with its residual alone in step 4; weights of the blocks are kept above
    1e-4, and those of least squares above 1e-10 of the largest (there 1e-8, absolute); residuals are those of the moved
    cameras, and the mean step is removed instead of anchoring a camera. The weights of step 4
    are multiplied by the `confidence` of the edges.

    Parameters
    ----------
    triangles
        How many triangles an edge has at most, drawn at random where it has more; by default a quarter of the median
        number over the edges in any, and no fewer than 30.
    rate, descent_iterations
        Size and number of the steps of the descent. The authors also use 1 and 30, on large real scenes.
    init
        Where to start: "gcw" as in step 3, the others see `start_rotations`.
    iterations
        Limit of step 4.
    tolerance_deg
        Mean step at which step 4 ends; the published 0.001 rad is 0.057 degrees.
    """

    triangles: int | None = parameter(None, at_least=1)
    rate: float = parameter(0.01, above=0)
    descent_iterations: int = parameter(100, at_least=1)
    init: Literal[Start, "gcw"] = "gcw"
    iterations: int = parameter(100, at_least=1)
    tolerance_deg: float = parameter(0.05, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        triangles = sample_triangles(problem, self.triangles or _quarter_of_the_median(problem), rng)
        levels = consistent_levels(triangles, self.rate, self.descent_iterations)
        if self.init == "gcw":
            start = weighted_spectral(problem, inlier_weights(levels), triangles.missing)
        else:
            start = start_rotations(self.init, problem, rng)

        def by_cycles(residuals: Floats) -> Floats:
            return np.where(triangles.missing, residuals, levels)

        found = refined(problem, start, levels, by_cycles, self.tolerance_deg, self.iterations)
        return replace(found, notes=note_on_missing(triangles.missing, "their residuals alone weigh them"))


def _quarter_of_the_median(problem: Problem) -> int:
    counts = codegrees(problem)
    if not counts.any():
        return FEWEST_TRIANGLES
    return max(int(np.ceil(np.median(counts[counts > 0]) / 4)), FEWEST_TRIANGLES)
