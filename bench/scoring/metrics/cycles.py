"""How well the measurements close around triangles, and whether wrong ones agree with each other."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.problem import Floats, Problem

SAMPLE = 20_000  # paths
WRONG_DEG = 10.0


@dataclass(frozen=True, eq=False)
class Cycles:
    """A sample of the triangles of a graph.

    Parameters
    ----------
    edges
        (k, 3) indices of the edges of each.
    residuals
        (k,) angles of R_ab R_bc R_ca, degrees.
    """

    edges: NDArray[np.intp]
    residuals: Floats


def sample_cycles(problem: Problem, size: int = SAMPLE) -> Cycles:
    """Triangles drawn uniformly and with replacement; the same ones for the same graph.

    So many paths a - c - b are drawn uniformly, the middle c in proportion to the number of its pairs of neighbours;
    those that an edge (a, b) closes are kept, and the others not replaced. Every triangle is closed from three paths,
    so none is preferred.
    """
    rng = np.random.default_rng(0)
    pair = problem.edges[:, 0].astype(np.int64) * problem.n + problem.edges[:, 1]
    _, once = np.unique(pair, return_index=True)  # of parallel edges the first
    names = np.zeros(problem.m)
    names[once] = once + 1.0
    graph = problem.adjacency(names)  # its values name the edges
    degree = np.diff(graph.indptr).astype(np.int64)
    pairs = degree * (degree - 1)
    if not pairs.any():
        return Cycles(np.empty((0, 3), dtype=np.intp), np.empty(0))
    middle = rng.choice(problem.n, size, p=pairs / pairs.sum()).astype(np.intp)
    first = (rng.random(size) * degree[middle]).astype(np.int64)
    second = (first + 1 + (rng.random(size) * (degree[middle] - 1)).astype(np.int64)) % degree[middle]
    one, other = graph.indptr[middle] + first, graph.indptr[middle] + second
    a, b = graph.indices[one].astype(np.intp), graph.indices[other].astype(np.intp)
    closing = np.asarray(graph[a, b]).ravel().astype(np.intp) - 1
    closed = closing >= 0
    edges = np.stack([graph.data[one] - 1, graph.data[other] - 1, closing], axis=1).astype(np.intp)[closed]
    a, b, c = a[closed], b[closed], middle[closed]
    sides = ((0, a, c), (1, c, b), (2, b, a))
    ac, cb, ba = (_directed(problem, edges[:, k], start, end) for k, start, end in sides)
    return Cycles(edges, np.degrees(so3.angle(ac @ cb @ ba)))


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


def _directed(problem: Problem, edges: NDArray[np.intp], start: NDArray[Any], end: NDArray[Any]) -> Floats:
    """Measured rotations (k, 3, 3) of edges, transposed where they are stored from `end` to `start`."""
    stored = problem.rotations[edges]
    return np.where((start < end)[:, None, None], stored, np.swapaxes(stored, -1, -2))
