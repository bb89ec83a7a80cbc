"""Triangles of a graph, a bounded number for each edge, and how inconsistent the measurements around them are.

No n x n matrix is formed: the neighbours of one camera are marked, and the shorter neighbour lists on the other side
of its edges are searched for marks.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints, Problem, so3

from ..loops.edge_kernels import compiled


@dataclass(frozen=True)
class Triangles:
    """Triangles over each edge; the triangle of edge (i, j) with camera k consists of its edge and two sides.

    Parameters
    ----------
    counts
        (m,) how many each edge has here. An edge without any is on no cycle of three in the graph.
    sides
        (m, k, 2): indices of the edges between i and k and between j and k; only the first `counts` are filled.
    inconsistency
        (m, k): angle of R_ij R_jk R_ki divided by pi, in [0, 1], d_ij,k in the literature.
    """

    counts: Ints
    sides: Ints
    inconsistency: Floats

    @property
    def missing(self) -> NDArray[np.bool_]:
        """(m,) whether an edge is in no triangle."""
        return self.counts == 0

    def weighted_means(self, values: Floats) -> Floats:
        """Mean (m,) inconsistency of the triangles over each edge, weighted by the product of the sides' `values`.

        An edge in no triangle gets 1, the worst there is: nothing speaks for it.

        Parameters
        ----------
        values
            (m,) positive.
        """
        means = np.empty(len(values))
        _weighted_means(self.counts, self.sides, self.inconsistency, values, means)
        return means


def note_on_missing(missing: NDArray[np.bool_], consequence: str) -> tuple[str, ...]:
    """What to say of the edges in no triangle, the mask (m,) of which is `missing`; nothing where there are none."""
    count = int(missing.sum())
    return (f"{count} of {len(missing)} edges in no triangle: {consequence}",) if count else ()


def sample_triangles(problem: Problem, most: int, rng: np.random.Generator) -> Triangles:
    """Up to `most` triangles over each edge: all where there are no more, else drawn without replacement.

    Where every edge has at most `most`, the result is the same whatever the generator, and does not depend on labels,
    order or direction of the edges, but for the order of the triangles of an edge.
    """
    offsets, neighbours, ids = _neighbours(problem)
    most = max(1, min(most, int(problem.degree.max()) - 1))
    counts = np.empty(problem.m, dtype=np.int32)
    sides = np.empty((problem.m, most, 2), dtype=np.int32)
    _sample(offsets, neighbours, ids, int(rng.integers(2**32)), counts, sides)
    inconsistency = np.zeros((problem.m, most))  # all of it is divided
    _cycle_angles(problem.edges, so3.to_quaternion(problem.rotations), counts, sides, inconsistency)
    inconsistency /= np.pi
    return Triangles(counts, sides, inconsistency)


def codegrees(problem: Problem) -> Ints:
    """(m,) number of triangles over each edge."""
    counts = np.empty(problem.m, dtype=np.int32)
    _count(*_neighbours(problem), counts)
    return counts


def _neighbours(problem: Problem) -> tuple[Ints, Ints, Ints]:
    """CSR lists: where that of each camera begins (n + 1,), its neighbours (2m,), and the edges to them (2m,)."""
    i, j = problem.edges.T
    ends, others = np.concatenate([i, j]), np.concatenate([j, i])
    order = np.lexsort((others, ends))
    first = np.concatenate([[0], np.cumsum(problem.degree)]).astype(np.int32)
    return first, others[order], (order % problem.m).astype(np.int32)


@compiled
def _count(offsets: Ints, neighbours: Ints, ids: Ints, counts: Ints) -> None:
    """Fill `counts` (m,), given the lists of `_neighbours`."""
    n = offsets.shape[0] - 1
    marked = np.zeros(n, dtype=np.bool_)
    for i in range(n):
        marked[neighbours[offsets[i] : offsets[i + 1]]] = True
        for p in range(offsets[i], offsets[i + 1]):
            j = neighbours[p]
            longer = offsets[j + 1] - offsets[j] - offsets[i + 1] + offsets[i]
            if longer > 0 or (longer == 0 and j > i):
                continue
            count = 0
            for q in range(offsets[j], offsets[j + 1]):
                count += marked[neighbours[q]]
            counts[ids[p]] = count
        marked[neighbours[offsets[i] : offsets[i + 1]]] = False


@compiled
def _sample(offsets: Ints, neighbours: Ints, ids: Ints, seed: int, counts: Ints, sides: Ints) -> None:
    """Fill `counts` (m,) and `sides` (m, k, 2) of `Triangles`, given the lists of `_neighbours`."""
    n, most = offsets.shape[0] - 1, sides.shape[1]
    to_i = np.full(n, -1, dtype=np.int32)
    found = np.empty((np.diff(offsets).max(), 2), dtype=np.int32)
    np.random.seed(seed)  # noqa: NPY002 - compiled code has a generator of its own
    for i in range(n):
        to_i[neighbours[offsets[i] : offsets[i + 1]]] = ids[offsets[i] : offsets[i + 1]]
        for p in range(offsets[i], offsets[i + 1]):
            j, edge = neighbours[p], ids[p]
            longer = offsets[j + 1] - offsets[j] - offsets[i + 1] + offsets[i]
            if longer > 0 or (longer == 0 and j > i):
                continue
            own = 0 if i < j else 1
            count = 0
            for q in range(offsets[j], offsets[j + 1]):
                side = to_i[neighbours[q]]
                if side >= 0:
                    found[count, own] = side
                    found[count, 1 - own] = ids[q]
                    count += 1
            taken = min(count, most)
            for t in range(taken):
                drawn = t if count <= most else t + np.random.randint(count - t)  # noqa: NPY002
                sides[edge, t, 0] = found[drawn, 0]
                sides[edge, t, 1] = found[drawn, 1]
                found[drawn, 0] = found[t, 0]
                found[drawn, 1] = found[t, 1]
            counts[edge] = taken
        to_i[neighbours[offsets[i] : offsets[i + 1]]] = -1


@compiled
def _cycle_angles(edges: Ints, measured: Floats, counts: Ints, sides: Ints, angles: Floats) -> None:
    """Fill `angles` (m, k) between R_ij R_jk and R_ik, from the chord between quaternions `measured` (m, 4)."""
    for e in range(edges.shape[0]):
        i, j = edges[e, 0], edges[e, 1]
        w, x, y, z = measured[e, 0], measured[e, 1], measured[e, 2], measured[e, 3]
        for t in range(counts[e]):
            f, g = sides[e, t, 0], sides[e, t, 1]
            sign = 1.0 if edges[g, 0] == j else -1.0
            a, b, c, d = measured[g, 0], sign * measured[g, 1], sign * measured[g, 2], sign * measured[g, 3]
            p = w * a - x * b - y * c - z * d
            q = w * b + x * a + y * d - z * c
            r = w * c - x * d + y * a + z * b
            s = w * d + x * c - y * b + z * a
            sign = 1.0 if edges[f, 0] == i else -1.0
            a, b, c, d = measured[f, 0], sign * measured[f, 1], sign * measured[f, 2], sign * measured[f, 3]
            sign = 1.0 if p * a + q * b + r * c + s * d >= 0 else -1.0
            p, q, r, s = p - sign * a, q - sign * b, r - sign * c, s - sign * d
            angles[e, t] = 4 * math.asin(min(1.0, math.sqrt(p * p + q * q + r * r + s * s) / 2))


@compiled
def _weighted_means(counts: Ints, sides: Ints, inconsistency: Floats, values: Floats, means: Floats) -> None:
    """Fill `means` (m,), see `Triangles.weighted_means`."""
    for e in range(counts.shape[0]):
        total = weighted = 0.0
        for t in range(counts[e]):
            weight = values[sides[e, t, 0]] * values[sides[e, t, 1]]
            total += weight
            weighted += weight * inconsistency[e, t]
        means[e] = weighted / total if counts[e] > 0 else 1.0
