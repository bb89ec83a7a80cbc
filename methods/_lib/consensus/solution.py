"""Where consensus ends, and how it comes there."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, Ints, Problem, so3

from ..descent.descent import Descent
from ..descent.losses import LOSSES
from ..graph.confidence import confidence
from ..linear.spectral import spectral_rotations
from ..starts import TOLERANCE
from .common_scale import with_common_scale
from .efficiency import Fit, most_precise
from .evidence import closing_angles, errors_are_normal, noise_scale, support_by_triangles, triangles_over_edges
from .growth import grown
from .half_edges import HalfEdges
from .prior import prior_weights
from .recombination import Judge, recombined
from .settling import SHARE, Settling

AGREEING = 5  # edges that are to agree with a camera
FACTORS = (0.5, 1.0, 2.0, 4.0)  # of the noise scale, at which solutions are grown
FACTORS_OF_LARGE, LARGE = (1.0, 2.0), 200_000  # edges, from which on fewer are affordable
EDGES, MOST_ROOTS = 20_000, 12  # cameras to grow from: as many times as a graph has fewer edges than this
ENOUGH_TRIANGLES = 1.0  # over an edge, on average, to vouch for edges
UNSUPPORTED = 1e-3  # triangles, in place of none at an edge
START_DEG, START = 8.0, 4.0  # where the scales of the cameras begin to fall; the larger of degrees and noise scales
STEPS_OF_L1, ENOUGH = 10, np.radians(0.057)  # of least absolute residuals, and the step that is the last
STEPS = 12  # of least squares, for each solution that was grown and for the final one
TOGETHER_DEG = 2.0  # where the scales of the final one begin
JUDGED, JUDGED_WIDE = 0.5, 2.0  # noise scales at which solutions are compared
APART = 4.0  # noise scales by which pieces stand elsewhere


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
    common_scale
        Whether all cameras have one scale, see `_need_common_scale`.
    note
        How it came about, in words.
    """

    settling: Settling
    judge: Judge
    descent: Descent
    fit: Fit
    noise: float
    common_scale: bool
    note: str

    def weights(self, angles: Floats) -> Floats:
        """(m,) of the edges, by that loss, for residuals (m,) in radians."""
        return self.settling.weights(angles, self.fit.scales, self.fit.power)


def solution(problem: Problem, agreeing: int = AGREEING) -> Solution:
    """Where the cameras come to rest; the steps are those of `Consensus`."""
    half = HalfEdges.of(problem)
    closing = closing_angles(half, problem.m)
    noise, common = noise_scale(closing), _need_common_scale(problem, half, closing, agreeing)
    judged, narrowest = (JUDGED_WIDE * noise, noise) if common else (JUDGED * noise, 0.0)
    prior = prior_weights(problem, noise)
    settling, judge = Settling(problem, half, prior, agreeing), Judge(problem, judged)
    starts = [so3.from_quaternion(start) for start in _starts(problem, half, prior, noise)]
    starts += [_least_absolute(problem)] if common else []
    widest = max(np.radians(START_DEG), START * noise)
    settled = [_settled(problem, settling, start, widest, narrowest) for start in starts]
    settled.sort(key=lambda descent: -judge.of_angles(descent.angles))
    cameras, pieces = settled[0].cameras, 0
    for other in settled[1:]:
        cameras, taken = recombined(judge, cameras, other.cameras, APART * noise)
        pieces += taken
    final = Descent(problem, so3.from_quaternion(cameras), 0.0)
    if common:
        fit = with_common_scale(problem, settling, final, noise, widest)
    else:
        fit = most_precise(problem, settling, final, settling.settle(final, np.radians(TOGETHER_DEG), STEPS))
    note = f"best of {len(settled)} solutions"
    note += f"; {pieces} piece{'s' * (pieces > 1)} of others taken over" if pieces else ""
    note += "; one scale for all cameras" if common else ""
    return Solution(settling, judge, final, fit, noise, common, note)


def _need_common_scale(problem: Problem, half: HalfEdges, closing: Ints, agreeing: int) -> bool:
    """Whether the scales of single cameras tell nothing.

    So it is where no triangles vouch for edges, and where errors are normal and cameras have so few edges that fewer
    than `agreeing` must agree: the smallest scale at which two or three do is then a matter of chance.
    """
    if triangles_over_edges(half, problem.m, closing) < ENOUGH_TRIANGLES:
        return True
    return bool(SHARE * problem.degree.mean() < agreeing) and errors_are_normal(closing)


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


def _least_absolute(problem: Problem) -> Floats:
    """The solution (n, 3, 3) with the least sum of absolute residuals near the spectral one."""
    start = spectral_rotations(problem, confidence(problem), regularisation=1.0, tolerance=TOLERANCE)[0]
    descent = Descent(problem, start, ENOUGH)
    descent.reweight(LOSSES["l1"], 1.0, STEPS_OF_L1)
    return so3.from_quaternion(descent.cameras)


def _settled(problem: Problem, settling: Settling, start: Floats, widest: float, narrowest: float) -> Descent:
    """A start (n, 3, 3) after reweighted least squares, with scales that fall from the widest; radians."""
    descent = Descent(problem, start, 0.0)
    settling.settle(descent, widest, STEPS, narrowest)
    return descent
