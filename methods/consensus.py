"""Consensus: solutions grown by votes, compared and combined by how many measurements each camera agrees with."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Problem, method, parameter, so3

from ._lib.consensus.growth import STRONGEST
from ._lib.consensus.solution import AGREEING, solution
from ._lib.consensus.uncertainty import camera_sigma
from ._lib.warm_up import solved_once


@method(
    "consensus",
    title="Consensus",
    cite="rotsync-bench",
    requires=("scipy", "numba"),
    robust=True,
    simple_graph=True,
    uses=("weights", "precisions", "gravity"),
)
@dataclass(frozen=True)
class Consensus:
    """Maximises how many measurements every camera agrees with, on the scale on which enough do.

    1. Triangles tell the noise scale and, at 0.5, 1, 2 and 4 times it, how many of them vouch for each edge.
    2. At each of these scales solutions are grown from the cameras of highest degree: every camera is put where most of
       its neighbours in place want it, votes counting by the triangles behind the edge; see `growth`.
    3. Each is settled by reweighted least squares over all edges. The weight is that of the Geman-McClure loss, with
       a scale s_i for each camera, the smallest at which `agreeing` of its edges agree; the scales fall towards these
       from wide ones. An edge counts with s_ij^-2, the larger of its cameras' scales; see `settling`.
    4. The best solution is the one with the largest sum over the cameras of log(0.2 + number of edges that agree at
       half the noise scale). The others differ from it piece by piece, and each piece of another solution that
       raises the sum is taken over: single cameras, and folded parts as a whole; see `recombination`.
    5. The result is settled again, with two, four or eight times wider losses where that makes cameras more precise:
       for errors that are nearly normal, as between poses; or with Cauchy's where errors crowd near zero and are
       independent; see `efficiency`. `camera_sigma` tells how far each camera may be off; see `uncertainty`.

    Between poses a camera's few edges do not tell its scale, and growth may have only votes to go by. Where there is
    less than one triangle over an edge, or cameras have few edges and triangles close as if errors were normal, the
    solution of least absolute residuals is a start too, no scale falls below that of the noise (5 degrees where there
    is no triangle), solutions are judged at twice of it, and in the end all cameras have the scale that makes them
    most precise; see `common_scale`.

    Weights and precisions multiply the weights of the edges, and so does what gravity says of them; see `prior`.

    Sources: the method is this project's own. Of its parts, annealing the scale of a Geman-McClure loss is that of
    graduated non-convexity (Yang et al. 2020; Sidhartha and Govindu 2024), the least squares steps are those of
    Chatterjee and Govindu (2018), growth by triplet support is in the spirit of HARA (Lee and Civera 2022). The
    constants were settled on simulated graphs (independent and camera-correlated noise, photo collections); which
    quantity is to be judged, and that its scale is to be narrow, was learned from the public training scans of
    ScanNet, Redwood and ICL-NUIM, where sets of wrong edges agree with each other, though less closely than right ones.

    Parameters
    ----------
    agreeing
        Edges that must agree with a camera; where it has few, 30 % of them, and at least two.
    """

    agreeing: int = parameter(AGREEING, at_least=1)

    def warm_up(self) -> None:
        """Compile the kernels, also those for cameras with more edges than take part in the growth."""
        solved_once(self, cameras=STRONGEST + 2)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        found = solution(problem, self.agreeing)
        weights = found.weights(found.descent.angles)
        return Estimate(
            so3.from_quaternion(found.descent.cameras),
            edge_weights=weights,
            camera_sigma=camera_sigma(problem, found.descent, weights, found.fit, found.noise, found.common_scale),
            iterations=found.descent.iterations,
            stop_reason="all steps done",
            cost=-found.judge.of_angles(found.descent.angles),
            notes=(found.note,),
        )
