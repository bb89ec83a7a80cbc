"""Where consensus ends, and how it comes there."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, Problem, so3

from ..descent.descent import Descent
from .efficiency import Fit, most_precise
from .evidence import noise_scale, support_by_triangles
from .growth import grown
from .half_edges import HalfEdges
from .prior import prior_weights
from .recombination import Judge, recombined
from .settling import Settling

AGREEING = 5  # edges that are to agree with a camera
FACTORS = (0.5, 1.0, 2.0, 4.0)  # of the noise scale, at which solutions are grown
FACTORS_OF_LARGE, LARGE = (1.0, 2.0), 200_000  # edges, from which on fewer are affordable
EDGES, MOST_ROOTS = 20_000, 12  # cameras to grow from: as many times as a graph has fewer edges than this
UNSUPPORTED = 1e-3  # triangles, in place of none at an edge
START_DEG, START = 8.0, 4.0  # where the scales of the cameras begin to fall; the larger of degrees and noise scales
STEPS = 12  # of least squares, for each solution that was grown and for the final one
TOGETHER_DEG = 2.0  # where the scales of the final one begin
JUDGED, APART = 0.5, 4.0  # noise scales at which solutions are compared, and by which they stand elsewhere


@dataclass(frozen=True, eq=False)
class Solution:
    """Cameras at rest, with what is known there.

    Parameters
    ----------
    settling, judge
        Of this problem.
    descent
        At the solution.
    fit
        The loss that it is settled with.
    noise
        The noise scale, radians.
    note
        How it came about, in words.
    """

    settling: Settling
    judge: Judge
    descent: Descent
    fit: Fit
    noise: float
    note: str

    def weights(self, angles: Floats) -> Floats:
        """(m,) of the edges, by that loss, for residuals (m,) in radians."""
        return self.settling.weights(angles, self.fit.scales, self.fit.power)


def solution(problem: Problem, agreeing: int = AGREEING) -> Solution:
    """Where the cameras come to rest; the steps are those of `Consensus`."""
    half = HalfEdges.of(problem)
    noise = noise_scale(half, problem.m)
    prior = prior_weights(problem, noise)
    settling, judge = Settling(problem, half, prior, agreeing), Judge(problem, JUDGED * noise)
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
