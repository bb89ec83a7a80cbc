"""Whether the measurements agree with each other: around triangles, or longer loops where there are none."""

from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.problem import Floats, Problem
from bench.scoring.conventions import readings
from bench.scoring.conventions.contrast import APART, LADDER_DEG, Contrast, contrast, logs, significant
from bench.scoring.conventions.readings import INVERSE, Change
from bench.scoring.metrics.cycles import sample_cycles

TRIANGLES = 5  # from which on they are enough
PATHS, MOST = 20_000, 10_000  # drawn for triangles, and triangles looked at
ROOTS, OF_ROOT = 40, 25  # trees that longer loops are taken from, and how many of each
WALKED = 50_000  # edges of all these loops together
PAIRS, STEPS = 10_000, 400_000  # loops of edges that do not belong together, and edges of all of these
CLOSES = 0.02  # of the loops, at least; of triangles with 60 % outliers 6 % are right
GAIN = 1.2  # so many times as many triangles close when edges are turned; with a tenth of the edges reversed 1.4
REVERSED = 0.1  # of the edges, from which on both directions are mixed
MIXED = 0.2  # of the triangles that close one way; 27 % do with a tenth of the edges reversed

Rows = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Loops:
    """Closed walks: edges (k, l), -1 past the end, and whether each is walked from i to j.

    Parameters
    ----------
    kind
        "triangles" or "loops".
    independent
        How many loops the graph has that do not follow from others.
    """

    edges: Rows
    forward: NDArray[np.bool_]
    kind: str
    independent: int


@dataclass(frozen=True, eq=False)
class Closing:
    """How loops close, degrees: as given, and under the reading that closes them if another clearly does.

    Parameters
    ----------
    null
        The same of edges drawn at random.
    reversed
        Share of the edges that agree with the others only when transposed.
    """

    kind: str
    given: Floats
    null: Floats
    best: Floats
    changes: tuple[Change, ...]
    contrast: Contrast
    reversed: float


def loops_of(problem: Problem) -> Loops:
    """A sample of triangles; of the shortest loops through edges outside spanning trees where those are few."""
    independent = problem.m - problem.n + int(problem.components.max()) + 1
    triangles = np.unique(np.sort(sample_cycles(problem, PATHS).edges, axis=1), axis=0)
    if len(triangles) >= TRIANGLES:
        triangles = np.random.default_rng(0).permutation(triangles)[:MOST]
        ends = problem.edges[triangles]
        before = np.roll(ends, 1, axis=1)
        return Loops(triangles, (ends[:, :, :1] == before).any(axis=2), "triangles", independent)
    return _loops_over_trees(problem, independent)


def closing(problem: Problem) -> Closing | None:
    """How the loops close; None where there are none."""
    loops = loops_of(problem)
    if not len(loops.edges):
        return None
    tried = [
        other
        for reading in readings.of_measurements(problem.rotations)
        for other in readings.both_ways(reading, INVERSE)
    ]
    residuals = [_residuals(loops, reading.rotations) for reading in tried]
    best = int(np.argmin([logs(values).mean() for values in residuals]))
    unrelated = _unrelated(loops, problem.m)
    if best:
        null = _residuals(unrelated, tried[best].rotations)
        independent = min(len(loops.edges), loops.independent)
        found = contrast(residuals[0], residuals[best], null, independent, len(tried), fits=CLOSES)
        if found:
            return Closing(loops.kind, residuals[0], null, residuals[best], tried[best].changes, found, 0.0)
    null = _residuals(unrelated, problem.rotations)
    turned, share, tolerance = _reversed(problem, loops, unrelated)
    closed = _residuals(replace(loops, forward=loops.forward ^ turned[loops.edges]), problem.rotations)
    at = Contrast.at(tolerance, residuals[0], closed)
    share = share if at.best >= GAIN * at.given else 0.0
    return Closing(loops.kind, residuals[0], null, closed, (), at, share)


def _unrelated(loops: Loops, m: int) -> Loops:
    """Loops of the same lengths, but of edges drawn at random."""
    rng = np.random.default_rng(0)
    rows = rng.integers(0, len(loops.edges), max(1, min(PAIRS, STEPS // loops.edges.shape[1])))
    edges = np.where(loops.edges[rows] >= 0, rng.integers(0, m, loops.edges[rows].shape), -1)
    return replace(loops, edges=edges, forward=loops.forward[rows])


def _residuals(loops: Loops, rotations: Floats) -> Floats:
    """(k,) angles of the products along the loops, degrees."""
    product_ = np.tile(np.eye(3), (len(loops.edges), 1, 1))
    for edge, forward in zip(loops.edges.T, loops.forward.T, strict=True):
        walked = edge >= 0
        steps = rotations[edge[walked]]
        steps = np.where(forward[walked, None, None], steps, np.swapaxes(steps, -1, -2))
        product_[walked] = product_[walked] @ steps
    return np.degrees(so3.angle(product_))


def _reversed(problem: Problem, loops: Loops, unrelated: Loops) -> tuple[NDArray[np.bool_], float, float]:
    """(m,) True on edges that close triangles only when transposed, their share, and to what; none if by chance."""
    best, most = (np.zeros(problem.m, dtype=bool), 0.0, LADDER_DEG[-1]), 0
    if loops.kind != "triangles":
        return best
    ways = list(product((False, True), repeat=3))
    patterns, mixed = np.array(ways), np.array([any(way) and not all(way) for way in ways])
    found, null = (
        np.transpose([_residuals(replace(walks, forward=walks.forward ^ way), problem.rotations) for way in patterns])
        for walks in (loops, unrelated)
    )
    which = found.argmin(axis=1)
    for tolerance in LADDER_DEG:
        clear, accident = _clear(found, tolerance), _clear(null, tolerance)
        hits = int((clear & mixed[which]).sum())
        chance = float(((accident & mixed[null.argmin(axis=1)]).sum() + 1) / (len(null) + 1))
        independent = min(len(found), loops.independent)
        few = clear.sum() < CLOSES * len(found) or hits < MIXED * clear.sum()
        if few or hits <= most or not significant(int(hits / len(found) * independent), independent, chance):
            continue
        votes = np.zeros((2, problem.m))
        for side in range(3):
            np.add.at(votes, (patterns[which[clear], side].astype(int), loops.edges[clear, side]), 1)
        turned = np.asarray(votes[1] > votes[0])
        share = float(turned.sum() / (votes.sum(axis=0) > 0).sum())
        if REVERSED <= share <= 1 - REVERSED:
            best, most = (turned, share, tolerance), hits
    return best


def _clear(ways: Floats, tolerance: float) -> NDArray[np.bool_]:
    """(k,) whether a triangle closes one way (k, 8), degrees, and by far no other."""
    two = np.sort(ways, axis=1)[:, :2]
    return np.asarray((two[:, 0] <= tolerance) & (two[:, 1] > APART * tolerance), dtype=bool)


def _loops_over_trees(problem: Problem, independent: int) -> Loops:
    """The shortest of the loops that edges outside breadth-first trees close."""
    from scipy.sparse.csgraph import breadth_first_order

    names = {(i, j): edge for edge, (i, j) in reversed(list(enumerate(problem.edges.tolist())))}
    pairs, graph = np.array(list(names)), problem.adjacency()
    rng = np.random.default_rng(0)
    found: dict[frozenset[int], list[tuple[int, int]]] = {}
    for root in rng.choice(problem.n, min(ROOTS, problem.n), replace=False).tolist():
        order, parent = breadth_first_order(graph, root, directed=False)
        above: list[int] = parent.tolist()
        depth = [0] * problem.n
        for camera in order[1:].tolist():
            depth[camera] = depth[above[camera]] + 1
        length = np.array(depth)[pairs].sum(axis=1)
        i, j = pairs.T
        outside = np.isin(i, order) & (parent[i] != j) & (parent[j] != i)
        for pair in pairs[outside][np.argsort(length[outside], kind="stable")[:OF_ROOT]].tolist():
            walk = _closed(pair, above)
            found.setdefault(frozenset(names[min(step), max(step)] for step in walk), walk)
    walks = sorted(found.values(), key=len)
    kept = [walk for walk, total in zip(walks, np.cumsum([len(w) for w in walks]), strict=True) if total <= WALKED]
    kept = kept or walks[:1]
    edges = np.full((len(kept), max(map(len, kept), default=0)), -1)
    forward = np.zeros(edges.shape, dtype=bool)
    for row, walk in enumerate(kept):
        edges[row, : len(walk)] = [names[min(step), max(step)] for step in walk]
        forward[row, : len(walk)] = [a < b for a, b in walk]
    return Loops(edges, forward, "loops", independent)


def _closed(pair: list[int], parent: list[int]) -> list[tuple[int, int]]:
    """Steps from the last common ancestor of two cameras down to one, over to the other, and up again."""
    ways = []
    for camera in pair:
        way = [camera]
        while parent[way[-1]] >= 0:
            way.append(parent[way[-1]])
        ways.append(way)
    down, up = ways
    while len(down) > 1 and len(up) > 1 and down[-2] == up[-2]:
        down.pop()
        up.pop()
    nodes = [*reversed(down), *up]
    return list(pairwise(nodes))
