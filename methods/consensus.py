"""Consensus: solutions grown by votes, compared and combined by how many measurements each camera agrees with."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter, so3

from ._lib.consensus.efficiency import most_precise
from ._lib.consensus.evidence import noise_scale, support_by_triangles
from ._lib.consensus.growth import STRONGEST, grown
from ._lib.consensus.half_edges import HalfEdges
from ._lib.consensus.prior import prior_weights
from ._lib.consensus.recombination import Judge, recombined
from ._lib.consensus.settling import Settling
from ._lib.consensus.solution import Solution
from ._lib.consensus.uncertainty import camera_sigma
from ._lib.descent.descent import Descent
from ._lib.warm_up import solved_once

FACTORS = (0.5, 1.0, 2.0, 4.0)  # of the noise scale, at which solutions are grown
FACTORS_OF_LARGE, LARGE = (1.0, 2.0), 200_000  # edges, from which on fewer are affordable
EDGES, MOST_ROOTS = 20_000, 12  # cameras to grow from: as many times as a graph has fewer edges than this
UNSUPPORTED = 1e-3  # triangles, in place of none at an edge
START_DEG, START = 8.0, 4.0  # where the scales of the cameras begin to fall; the larger of degrees and noise scales
STEPS = 12  # of least squares, for each solution that was grown and for the final one
TOGETHER_DEG = 2.0  # where the scales of the final one begin
JUDGED, APART = 0.5, 4.0  # noise scales at which solutions are compared, and by which they stand elsewhere


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

    agreeing: int = parameter(5, at_least=1)

    def warm_up(self) -> None:
        """Compile the kernels, also those for cameras with more edges than take part in the growth."""
        solved_once(self, cameras=STRONGEST + 2)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        found = self.solution(problem)
        weights = found.weights(found.descent.angles)
        return Estimate(
            so3.from_quaternion(found.descent.cameras),
            edge_weights=weights,
            camera_sigma=camera_sigma(problem, found.descent, weights, found.fit, found.noise),
            iterations=found.descent.iterations,
            stop_reason="all steps done",
            cost=-found.judge.of_angles(found.descent.angles),
            notes=(found.note,),
        )

    def solution(self, problem: Problem) -> Solution:
        """Where the cameras come to rest, for methods that go on from there."""
        half = HalfEdges.of(problem)
        noise = noise_scale(half, problem.m)
        prior = prior_weights(problem, noise)
        settling, judge = Settling(problem, half, prior, self.agreeing), Judge(problem, JUDGED * noise)
        settled = [_settled(problem, settling, noise, start) for start in _starts(problem, half, prior, noise)]
        settled.sort(key=lambda descent: -judge.of_angles(descent.angles))
        cameras, pieces = settled[0].cameras, 0
        for other in settled[1:]:
            cameras, taken = recombined(judge, cameras, other.cameras, APART * noise)
            pieces += taken
        final = Descent(problem, so3.from_quaternion(cameras), 0.0)
        narrow = settling.settle(final, np.radians(TOGETHER_DEG), STEPS)
        fit = most_precise(problem, settling, final, narrow)
        taken_over = f"; {pieces} piece{'s' * (pieces > 1)} of others taken over" if pieces else ""
        return Solution(settling, judge, final, fit, noise, f"best of {len(settled)} solutions{taken_over}")


def _starts(problem: Problem, half: HalfEdges, prior: Floats, noise: float) -> list[Floats]:
    """Solutions (n, 4) grown at several scales, from several cameras where the graph is small."""
    factors = np.array(FACTORS if problem.m < LARGE else FACTORS_OF_LARGE)
    count = int(np.clip(EDGES // problem.m, 1, MOST_ROOTS))
    roots = np.argsort(half.ranks)[:count].tolist()
    support = support_by_triangles(half, problem.m, factors * noise)
    return [
        grown(half, prior * (vouching + UNSUPPORTED), factor * noise, root)
        for factor, vouching in zip(factors.tolist(), support, strict=True)
        for root in roots
    ]


def _settled(problem: Problem, settling: Settling, noise: float, start: Floats) -> Descent:
    """A grown solution (n, 4) after reweighted least squares."""
    descent = Descent(problem, so3.from_quaternion(start), 0.0)
    settling.settle(descent, max(np.radians(START_DEG), START * noise), STEPS)
    return descent
