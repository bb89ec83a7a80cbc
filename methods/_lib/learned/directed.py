"""A view graph as networks see it: every edge in both directions, sorted by the camera that gets its message."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bench import Floats, Ints, Problem, so3


@dataclass(frozen=True, eq=False)
class DirectedGraph:
    """Every edge twice, sorted by camera.

    Parameters
    ----------
    n
        Number of cameras.
    at, other
        (2m,) the camera a directed edge leaves and the one it leads to; `at` ascends, every camera occurs in it.
    rotations
        (2m, 3, 3) measured R_at R_other^T.
    edge
        (2m,) the edge of the problem that each is a direction of.
    reverse
        (2m,) where the other direction of each is.
    forward
        (2m,) 1 where a directed edge leads as the problem has it, -1 where it is the other direction.
    """

    n: int
    at: Ints
    other: Ints
    rotations: Floats
    edge: Ints
    reverse: Ints
    forward: Floats

    @classmethod
    def of(cls, problem: Problem) -> "DirectedGraph":
        """Both directions of the edges of a connected problem."""
        i, j = problem.edges.T
        at, other = np.concatenate([i, j]), np.concatenate([j, i])
        rotations = np.concatenate([problem.rotations, np.swapaxes(problem.rotations, 1, 2)])
        order = np.lexsort((other, at))
        place = np.empty(2 * problem.m, np.int32)
        place[order] = np.arange(2 * problem.m, dtype=np.int32)
        reverse = np.concatenate([place[problem.m :], place[: problem.m]])[order]
        edge, forward = (order % problem.m).astype(np.int32), np.where(order < problem.m, 1.0, -1.0)
        return cls(problem.n, at[order], other[order], rotations[order], edge, reverse, forward)

    @cached_property
    def starts(self) -> Ints:
        """(n,) where the edges of each camera begin: what `np.add.reduceat` takes."""
        return np.searchsorted(self.at, np.arange(self.n)).astype(np.int32)

    @cached_property
    def first(self) -> Ints:
        """(n + 1,) where the edges of each camera begin, and where the last one's end."""
        return np.append(self.starts, len(self.at)).astype(np.int32)

    @cached_property
    def degree(self) -> Ints:
        """(n,) number of edges of each camera."""
        return np.bincount(self.at, minlength=self.n).astype(np.int32)

    @cached_property
    def quaternions(self) -> Floats:
        """(2m, 4) the measurements as unit quaternions, scalar first and not negative."""
        q = so3.to_quaternion(self.rotations)
        return np.where(q[:, :1] < 0, -q, q)

    def sums(self, values: Floats) -> Floats:
        """(n, k) sum over the edges of each camera of values (2m, k)."""
        return np.add.reduceat(values, self.starts, axis=0)

    def means(self, values: Floats) -> Floats:
        """(n, k) mean over the edges of each camera of values (2m, k)."""
        return self.sums(values) / self.degree[:, None]
