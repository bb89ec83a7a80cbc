"""How well the measurements close around triangles, and whether wrong ones agree with each other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.core.problem import Floats, Problem
from bench.core.triangles import closures, sample_triangles

SAMPLE = 20_000
WRONG_DEG = 10.0


@dataclass(frozen=True, eq=False)
class Cycles:
    """A sample of the triangles of a graph.

    Parameters
    ----------
    edges
        (k, 3) indices of the edges of each.
    residuals
        (k,) angles by which they do not close, degrees.
    """

    edges: NDArray[np.intp]
    residuals: Floats


def sample_cycles(problem: Problem, size: int = SAMPLE) -> Cycles:
    """At most `size` triangles drawn uniformly and with replacement; the same ones for the same graph."""
    edges = sample_triangles(problem, size, np.random.default_rng(0))
    return Cycles(edges, np.degrees(closures(problem.rotations, edges)))


def agreeing_share(cycles: Cycles, at_truth: Floats) -> float:
    """Share of the triangles with a wrong edge that close all the same: of wrong edges that agree with each other.

    Twice the share that closes as well as the better half of the triangles without a wrong edge, and at most 1. Of
    independent errors it is next to zero. NaN where there are no triangles of either kind.

    Parameters
    ----------
    cycles
        Triangles.
    at_truth
        (m,) residuals of the edges at the truth, degrees; above `WRONG_DEG` an edge is wrong. NaN where unknown; such
        triangles take no part.
    """
    worst = at_truth[cycles.edges].max(axis=1, initial=-np.inf)
    wrong, right = worst > WRONG_DEG, worst <= WRONG_DEG
    if not wrong.any() or not right.any():
        return float("nan")
    closing = cycles.residuals[wrong] <= np.median(cycles.residuals[right])
    return min(1.0, 2 * float(closing.mean()))
