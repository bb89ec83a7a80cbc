"""Rotation coordinate descent."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Problem, method, parameter

from ._lib.graph.neighbours import neighbours_of
from ._lib.linear.certificate import ROUNDING, chordal_cost, smallest_eigenvalue
from ._lib.loops import camera_kernels
from ._lib.starts import Seeded, Start, start_rotations


@method(
    "rcd",
    title="RCD",
    cite="parra2021",
    requires=("scipy", "numba"),
    certifies=True,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class RCD(Seeded):
    """Minimises the sum of squared chordal residuals over one camera at a time.

    1. Start from `init`.
    2. One epoch visits the cameras in order and replaces each R_k by the rotation nearest to
       sum_j w_kj R_kj R_j, its neighbours being where they are by then.
    3. Stop when an epoch lowers the cost by less than the tolerance, relative to the cost.

    Source: Parra et al., CVPR 2021, algorithm 2: the block coordinate descent of Eriksson et al. 2018 on the
    semidefinite relaxation (see `bcd`), whose iterate stays R R^T when it starts as one, so that a step costs
    the degree of a camera and not n^2. Deviations: the gauge is left alone, where theirs turns every camera so
    that R_k = I at its step; the nearest orthogonal matrix is always a rotation; the default start is spectral,
    theirs random; the tolerance is 1e-10, theirs 1e-9.

    On SO(3)^n this is a local method. Whether the global minimum was found is what `Estimate.certificate` says.
    The terms are weighted by the `confidence` of the edges.

    Parameters
    ----------
    init
        Where to start, see `start_rotations`.
    tolerance
        Relative decrease of the cost in one epoch at which it ends.
    max_epochs
        Where it ends at the latest.
    """

    init: Start = "spectral"
    tolerance: float = parameter(1e-10, at_least=0)
    max_epochs: int = parameter(1000, at_least=1)

    @property
    def invariant_to_deg(self) -> float | None:
        """The cameras take turns by label, and it stops before the last digits agree; nothing from a random start."""
        return None if self.init == "random" else 0.02

    @property
    def exact_to_deg(self) -> float | None:
        """Nothing is promised from a random start: a ring that winds around is a local minimum."""
        return None if self.init == "random" else 1e-6

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        rotations = np.array(start_rotations(self.init, problem, rng), order="C")
        seen = neighbours_of(problem)
        measured = seen.weights[:, None, None] * seen.rotations
        cost, gain = chordal_cost(problem, rotations), np.empty(1)
        reason, epochs = "epoch limit", 0
        while epochs < self.max_epochs:
            camera_kernels.rotation_sweep(seen.first, seen.cameras, measured, rotations, gain)
            cost -= 2 * gain[0]
            epochs += 1
            if 2 * gain[0] <= max(self.tolerance * cost, ROUNDING * problem.m):
                reason = f"decrease of the cost below {self.tolerance:g} of it"
                break
        return Estimate(
            rotations,
            iterations=epochs,
            stop_reason=reason,
            cost=chordal_cost(problem, rotations),
            certificate=smallest_eigenvalue(problem, rotations),
        )
