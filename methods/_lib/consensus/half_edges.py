"""The edges as each camera sees them, in an order that does not depend on the names of the cameras."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints, Problem, so3

from ..loops import edge_kernels


@dataclass(frozen=True, eq=False)
class HalfEdges:
    """Every edge twice, once from each of its ends; rows ``first[k]`` to ``first[k + 1]`` leave camera k.

    Parameters
    ----------
    ranks
        (n,) of the cameras, all different: those of high degree first, among equals those with the smaller sum of
        measured angles.
    first
        (n + 1,).
    others
        (2m,) the camera at the other end, those of highest rank first.
    ids
        (2m,) the edge.
    quaternions
        (2m, 4) of R_kj for the edge to camera j.
    """

    ranks: Ints
    first: Ints
    others: Ints
    ids: Ints
    quaternions: Floats

    @classmethod
    def of(cls, problem: Problem) -> "HalfEdges":
        """Of all edges of a problem."""
        i, j = problem.edges.T
        m = problem.m
        ends, others = np.concatenate([i, j]), np.concatenate([j, i])
        ranks = _ranks(problem)
        order = np.argsort(ends * np.int64(problem.n) + ranks[others])
        quaternions = np.empty((m, 4))
        edge_kernels.quaternions(problem.rotations, quaternions)
        both = np.concatenate([quaternions, quaternions * [1.0, -1.0, -1.0, -1.0]])
        first = np.concatenate([[0], np.cumsum(problem.degree)]).astype(np.int32)
        return cls(ranks, first, others[order].astype(np.int32), (order % m).astype(np.int32), both[order])

    def strongest(self, weights: Floats, most: int) -> "HalfEdges":
        """Those of the edges that are among the `most` of largest `weights` (m,) at one of their ends at least.

        All edges, where these alone do not connect the cameras.
        """
        degree = np.diff(self.first)
        if degree.max() <= most:
            return self
        among = np.zeros(len(weights), dtype=np.bool_)
        _mark_strongest(self.first, self.ids, weights, most, among)
        kept = np.flatnonzero(among[self.ids])
        first = np.searchsorted(kept, self.first).astype(np.int32)
        found = HalfEdges(
            self.ranks, first, self.others.take(kept), self.ids.take(kept), self.quaternions.take(kept, axis=0)
        )
        return found if found.connected else self

    @property
    def connected(self) -> bool:
        """Whether every camera can be reached from every other."""
        reached = np.zeros(len(self.first) - 1, dtype=np.bool_)
        _reach(self.first, self.others, reached)
        return bool(reached.all())


@edge_kernels.compiled
def _reach(first: Ints, others: Ints, reached: NDArray[np.bool_]) -> None:
    """Mark in `reached` (n,) the cameras that can be reached from the first one."""
    waiting = np.zeros(len(reached), dtype=np.int32)
    reached[0], count = True, 1
    while count > 0:
        count -= 1
        camera = waiting[count]
        for h in range(first[camera], first[camera + 1]):
            if not reached[others[h]]:
                reached[others[h]] = True
                waiting[count] = others[h]
                count += 1


@edge_kernels.compiled
def _mark_strongest(first: Ints, ids: Ints, weights: Floats, most: int, among: NDArray[np.bool_]) -> None:
    """Mark in `among` (m,) the `most` edges of largest `weights` (m,) at each camera, of equals those that come first.

    Parameters
    ----------
    first, ids
        See `HalfEdges`.
    """
    for i in range(len(first) - 1):
        own = ids[first[i] : first[i + 1]]
        if len(own) <= most:
            among[own] = True
            continue
        least = np.partition(weights[own], len(own) - most)[len(own) - most]
        equal = most
        for edge in own:
            if weights[edge] > least:
                among[edge] = True
                equal -= 1
        for edge in own:
            if weights[edge] == least and equal > 0:
                among[edge] = True
                equal -= 1


def _ranks(problem: Problem) -> Ints:
    """(n,) see `HalfEdges`."""
    totals = np.bincount(problem.edges.ravel(), np.repeat(so3.angle(problem.rotations), 2), minlength=problem.n)
    result = np.empty(problem.n, dtype=np.int32)
    result[np.lexsort((totals, -problem.degree))] = np.arange(problem.n, dtype=np.int32)
    return result
