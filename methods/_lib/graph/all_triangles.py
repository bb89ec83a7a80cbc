"""All triangles of a graph, how far each is from closing, and how many that close support each edge."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints, Problem, so3

from ..loops.edge_kernels import compiled

Single = NDArray[np.float32]


@dataclass(frozen=True)
class AllTriangles:
    """Three cameras i < j < k with all three edges measured.

    Parameters
    ----------
    edges
        (t, 3) ids of the edges (i, j), (j, k) and (i, k).
    errors
        (t,) squared Frobenius norm of R_ij R_jk - R_ik, between 0 and 8.
    """

    edges: Ints
    errors: Single

    @classmethod
    def of(cls, problem: Problem) -> "AllTriangles":
        """Find all triangles of a problem, in time proportional to the number of two-edge paths."""
        by_camera = np.lexsort((problem.edges[:, 1], problem.edges[:, 0])).astype(np.int32)
        i, other = problem.edges[by_camera].T
        first = np.searchsorted(i, np.arange(problem.n + 1)).astype(np.int32)
        other, counts = np.ascontiguousarray(other), np.zeros(problem.n + 1, dtype=np.int64)
        count_triangles(first, other, counts[1:])
        starts = np.cumsum(counts)
        edges = np.empty((starts[-1], 3), dtype=np.int32)
        errors = np.empty(starts[-1], dtype=np.float32)
        fill_triangles(first, other, by_camera, so3.to_quaternion(problem.rotations), starts, edges, errors)
        return cls(edges, errors)

    def support(self, closing: NDArray[np.bool_], m: int) -> NDArray[np.intp]:
        """(m,) number of triangles at each edge among those that are `closing` (t,)."""
        return np.bincount(self.edges[closing].ravel(), minlength=m)

    def missing(self, m: int) -> NDArray[np.bool_]:
        """(m,) whether an edge is in no triangle."""
        return np.bincount(self.edges.ravel(), minlength=m) == 0

    def mean_distance(self, m: int) -> Floats:
        """(m,) mean of the norms, not squared, over the triangles at each edge; 0 where there is none."""
        distances, sums = np.sqrt(self.errors), np.zeros(m)
        for side in self.edges.T:
            sums += np.bincount(side, distances, minlength=m)
        return sums / np.maximum(np.bincount(self.edges.ravel(), minlength=m), 1)


@compiled
def count_triangles(first: Ints, other: Ints, counts: NDArray[np.int64]) -> None:
    """Count the triangles whose first camera is i.

    Parameters
    ----------
    first, other
        (n + 1,) and (m,): the neighbours j > i of camera i are other[first[i] : first[i + 1]].
    counts
        (n,) filled.
    """
    mark = np.full(len(counts), -1)
    for i in range(len(counts)):
        for a in range(first[i], first[i + 1]):
            mark[other[a]] = i
        counts[i] = 0
        for a in range(first[i], first[i + 1]):
            for b in range(first[other[a]], first[other[a] + 1]):
                if mark[other[b]] == i:
                    counts[i] += 1


@compiled
def fill_triangles(
    first: Ints, other: Ints, ids: Ints, measured: Floats, starts: NDArray[np.int64], edges: Ints, errors: Single
) -> None:
    """List the triangles and their errors.

    Parameters
    ----------
    first, other, ids
        As for `count_triangles`, and the edge that leads to each neighbour.
    measured
        (m, 4) unit quaternions of R_ij.
    starts
        (n + 1,) where the triangles of each first camera begin.
    edges, errors
        Filled, see `AllTriangles`.
    """
    n = len(first) - 1
    place = np.full(n, -1)
    for i in range(n):
        for a in range(first[i], first[i + 1]):
            place[other[a]] = a
        t = starts[i]
        for a in range(first[i], first[i + 1]):
            w, x, y, z = measured[ids[a]]
            for b in range(first[other[a]], first[other[a] + 1]):
                c = place[other[b]]
                if c < 0:
                    continue
                q, r, s, u = measured[ids[b]]
                d, e, f, g = measured[ids[c]]
                p0 = w * q - x * r - y * s - z * u
                p1 = w * r + x * q + y * u - z * s
                p2 = w * s - x * u + y * q + z * r
                p3 = w * u + x * s - y * r + z * q
                v1 = d * p1 - p0 * e - p2 * g + p3 * f
                v2 = d * p2 - p0 * f - p3 * e + p1 * g
                v3 = d * p3 - p0 * g - p1 * f + p2 * e
                edges[t, 0], edges[t, 1], edges[t, 2] = ids[a], ids[b], ids[c]
                errors[t] = 8 * (v1 * v1 + v2 * v2 + v3 * v3)
                t += 1
        for a in range(first[i], first[i + 1]):
            place[other[a]] = -1
