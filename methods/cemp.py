"""CEMP: cycle-edge message passing, followed by a spanning tree or a weighted spectral solution."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench import Estimate, Problem, method, parameter

from ._lib.graph.cemp import (
    ITERATIONS,
    MOST_ITERATIONS,
    TRIANGLES,
    corruption_levels,
    inlier_weights,
    tree_of_least_corruption,
)
from ._lib.graph.triangles import note_on_missing, sample_triangles
from ._lib.linear.spectral import weighted_spectral
from ._lib.warm_up import Warm


@method(
    "cemp",
    title="CEMP",
    cite="lerman2022",
    requires=("scipy", "numba"),
    robust=True,
    simple_graph=True,
    deterministic=False,
)
@dataclass(frozen=True)
class CEMP(Warm):
    """Estimates how corrupted each edge is from the triangles over it alone, then solves with the good edges.

    1. Take up to `triangles` triangles over each edge and their inconsistencies d_ij,k, the angle of R_ij R_jk R_ki
       divided by pi.
    2. s_ij = the mean of d_ij,k; then, `iterations` times, the mean with weights exp(-beta (s_ik + s_jk)), beta = 1,
       2, 4, ... . An edge in no triangle keeps s = 1, the worst.
    3. "mst": propagate along the spanning tree of smallest total s. "gcw": the spectral solution with each block
       weighted by exp(-beta s_ij), with the last beta, normalised by the weights of each camera.

    Source: Lerman and Shi, FoCM 2022 (algorithm 1), with the schedule and the two solvers of Shi and Lerman, ICML
    2020, section 4. Deviations: triangles are drawn without replacement; in "gcw" edges in no triangle get the median
    weight of the others (else parts that hang together by such edges fall apart), weights are kept above 1e-4, and
    each camera has an identity block of the mean weight of its edges. The weights of a problem are not used.

    The edge weights of the estimate are exp(-beta s_ij), for either solver.

    Parameters
    ----------
    solver
        What makes rotations from s.
    triangles
        How many triangles an edge has at most. Where it has more they are drawn at random.
    iterations
        Of message passing.
    """

    solver: Literal["mst", "gcw"] = "mst"
    triangles: int = parameter(TRIANGLES, at_least=1)
    iterations: int = parameter(ITERATIONS, at_least=1, at_most=MOST_ITERATIONS)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        triangles = sample_triangles(problem, self.triangles, rng)
        levels = corruption_levels(triangles, self.iterations)
        weights = inlier_weights(levels, self.iterations)
        if self.solver == "mst":
            rotations = tree_of_least_corruption(problem, levels)
        else:
            rotations = weighted_spectral(problem, weights, triangles.missing)
        return Estimate(
            rotations,
            edge_weights=weights,
            iterations=self.iterations,
            stop_reason="every iteration done",
            notes=note_on_missing(triangles.missing, "nothing is known of how good they are"),
        )
