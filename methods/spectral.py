"""Spectral synchronization: the three leading eigenvectors of the block matrix of the measurements."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Problem, method

from ._lib.graph.confidence import confidence
from ._lib.linear.eigen import PRECISE
from ._lib.linear.spectral import spectral_rotations
from ._lib.warm_up import Warm


@method(
    "spectral", title="Spectral", cite="arienachimson2012", requires=("scipy", "numba"), uses=("weights", "precisions")
)
@dataclass(frozen=True)
class Spectral(Warm):
    """Maximises sum_ij trace(R_i^T R_ij R_j) with the constraint relaxed to orthonormal columns.

    1. G holds R_ij in block (i, j), its transpose in block (j, i) and identities on the diagonal; with
       `normalised` it becomes D^(-1/2) G D^(-1/2), where D is the degree plus one.
    2. Take its three algebraically largest eigenvectors, cut them into one block for each camera and, when
       most blocks are reflections, change the sign of one eigenvector: the reflection is one for all
       cameras.
    3. Replace every block by the nearest rotation.

    Sources: Singer 2011 (for SO(2), normalised), Arie-Nachimson et al. 2012, section 4 (for SO(3)).
    Deviations: none in what is computed; D^(-1/2) is not applied to the eigenvectors, because a positive
    factor does not move the nearest rotation. How the eigenvectors are found follows from the graph (see
    `spectral_rotations`). Where the measurements come with weights or precisions, the block of each edge is multiplied
    by its `confidence`, D is the sum of those and the diagonal blocks their means.

    Parameters
    ----------
    normalised
        Whether to divide by the degrees. Without, the eigenvectors concentrate on cameras with many
        measurements; where degrees differ much (trajectories that cross) the blocks of the others sink
        below rounding.
    """

    normalised: bool = True

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        rotations, found = spectral_rotations(problem, confidence(problem), normalised=self.normalised)
        if found.error <= PRECISE:
            return Estimate(rotations, iterations=found.products, stop_reason="eigenvectors converged")
        note = f"the eigenvectors are known to {np.degrees(found.error):.1e} degrees only: the gap is too small"
        return Estimate(rotations, iterations=found.products, stop_reason="eigenvectors not separated", notes=(note,))
