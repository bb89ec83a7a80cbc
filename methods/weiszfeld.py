"""Weiszfeld's algorithm: every camera in turn moves to the median of what its neighbours predict."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Ints, Problem, method, parameter, so3

from ._lib.graph.confidence import confidence, strengths
from ._lib.graph.neighbours import neighbours_of
from ._lib.loops import camera_kernels
from ._lib.starts import Start, Started, start_rotations

MET = 1e-9  # radians; a prediction this close to the camera counts as met


@method(
    "weiszfeld",
    title="Weiszfeld",
    cite="hartley2011",
    requires=("scipy", "numba"),
    robust=True,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class Weiszfeld(Started):
    """Minimises sum_ij w_ij angle(R_i R_j^T, R_ij), one camera at a time; w is the `confidence` of the edges.

    1. Start from `init`.
    2. Sweep over the cameras. Each takes one step of Weiszfeld's algorithm towards the geodesic L1 median of
       R_ij R_j over its neighbours j, in the tangent space at R_i: the mean of the vectors
       log(R_ij R_j R_i^T), each times w_ij / length, over the sum of the w_ij / length. The cameras
       after it see the new value.
    3. Stop when the mean step of a sweep is below the tolerance.

    One camera at a time cannot leave every point that is not a minimum: where two cameras fit their common
    edge exactly neither may gain by moving alone. On five 1DSfM scenes the costs reached from a spanning tree
    and from the spectral solution nevertheless agree to 0.1 %. Loosely connected parts of a graph turn slowly,
    over hundreds of sweeps.

    Source: Hartley, Aftab and Trumpf, CVPR 2011, section 6. Deviations: where a camera coincides with a
    prediction, as every camera of a spanning tree does, the step is that of Vardi and Zhang (2000), where
    Weiszfeld's is 0/0; the terms are weighted; cameras move in the order of falling degree (the sum of their w;
    ties: the smaller weighted sum of measured angles first), so that labels do not matter.

    Parameters
    ----------
    init
        Where to start, see `start_rotations`; the paper's is a spanning tree.
    sweeps
        Largest number of sweeps.
    tolerance_deg
        Mean step at which it ends.
    """

    init: Start = "spanning-tree"
    sweeps: int = parameter(1000, at_least=0)
    tolerance_deg: float = parameter(1e-3, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        cameras = so3.to_quaternion(start_rotations(self.init, problem, rng))
        order, seen = _order(problem), neighbours_of(problem)
        measured = so3.to_quaternion(seen.rotations)
        turns = np.empty(problem.n)
        reason, done = "iteration limit", 0
        while done < self.sweeps:
            camera_kernels.median_sweep(order, seen.first, seen.cameras, measured, seen.weights, MET, cameras, turns)
            done += 1
            if turns.mean() < np.radians(self.tolerance_deg):
                reason = f"mean step below {self.tolerance_deg:g} degrees"
                break
        rotations = so3.from_quaternion(cameras)
        cost = float((confidence(problem) * problem.residuals(rotations)).sum())
        return Estimate(rotations, iterations=done, stop_reason=reason, cost=cost)


def _order(problem: Problem) -> Ints:
    """Cameras (n,) in the order in which they move."""
    angles = np.repeat(confidence(problem) * so3.angle(problem.rotations), 2)
    return np.lexsort((np.bincount(problem.edges.ravel(), angles), -strengths(problem))).astype(np.int32)
