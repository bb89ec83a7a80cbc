"""The edges as each camera sees them, in an order that does not depend on the names of the cameras."""

from dataclasses import dataclass

import numpy as np

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
        order = np.lexsort((ranks[others], ends))
        quaternions = np.empty((m, 4))
        edge_kernels.quaternions(problem.rotations, quaternions)
        both = np.concatenate([quaternions, quaternions * [1.0, -1.0, -1.0, -1.0]])
        first = np.concatenate([[0], np.cumsum(problem.degree)]).astype(np.int32)
        return cls(ranks, first, others[order].astype(np.int32), (order % m).astype(np.int32), both[order])

    def strongest(self, weights: Floats, most: int) -> "HalfEdges":
        """Those of the edges that are among the `most` of largest `weights` (m,) at one of their ends at least."""
        degree = np.diff(self.first)
        if degree.max() <= most:
            return self
        ends = np.repeat(np.arange(len(degree)), degree)
        order = np.lexsort((-weights[self.ids], ends))
        place = np.arange(len(order)) - np.repeat(self.first[:-1], degree)
        among = np.zeros(len(weights), dtype=np.bool_)
        among[self.ids[order[place < most]]] = True
        kept = among[self.ids]
        first = np.concatenate([[0], np.cumsum(np.bincount(ends[kept], minlength=len(degree)))]).astype(np.int32)
        return HalfEdges(self.ranks, first, self.others[kept], self.ids[kept], self.quaternions[kept])


def _ranks(problem: Problem) -> Ints:
    """(n,) see `HalfEdges`."""
    totals = np.bincount(problem.edges.ravel(), np.repeat(so3.angle(problem.rotations), 2), minlength=problem.n)
    result = np.empty(problem.n, dtype=np.int32)
    result[np.lexsort((totals, -problem.degree))] = np.arange(problem.n, dtype=np.int32)
    return result
