"""Triangles drawn from a graph, and how far the measurements around each are from closing."""

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.problem import Floats, Problem

_BATCHES = 64  # of pairs of neighbours that are tried, each as large as the number of triangles wanted


def sample_triangles(problem: Problem, count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Draw triangles uniformly, with replacement, at a cost linear in the edges.

    Pairs of neighbours of a camera are drawn uniformly among all such pairs, and kept where they are joined (wedge
    sampling, Schank and Wagner 2005). Of a pair that is measured several times the first measurement counts.

    Returns
    -------
    (k, 3) edges ij, jk and ik of triangles i < j < k, with k at most `count` and less where the graph has few; none
    where it has none.
    """
    n = problem.n
    key, edge = np.unique(problem.edges[:, 0].astype(np.int64) * n + problem.edges[:, 1], return_index=True)
    i, j = key // n, key % n
    owner, neighbour = np.concatenate([i, j]), np.concatenate([j, i])[np.argsort(np.concatenate([i, j]), kind="stable")]
    degree = np.bincount(owner, minlength=n)
    first = np.cumsum(degree) - degree
    pairs = np.cumsum(degree * (degree - 1) // 2)
    found: list[NDArray[np.intp]] = []
    missing = count if pairs[-1] else 0
    for _ in range(_BATCHES):
        if missing <= 0:
            break
        a = np.searchsorted(pairs, rng.integers(pairs[-1], size=count), side="right")
        one = rng.integers(degree[a])
        other = rng.integers(degree[a] - 1)
        other += other >= one
        cameras = np.sort(np.stack([a, neighbour[first[a] + one], neighbour[first[a] + other]]), axis=0)
        places = [_place(key, cameras[x] * n + cameras[y]) for x, y in ((0, 1), (1, 2), (0, 2))]
        closed = np.all([place >= 0 for place in places], axis=0)
        found.append(edge[np.stack(places, axis=1)[closed]])
        missing -= int(closed.sum())
    return np.concatenate([np.empty((0, 3), dtype=np.intp), *found])[:count]


def closures(rotations: Floats, triangles: NDArray[np.intp]) -> Floats:
    """Angles (k,) of R_ij R_jk R_ik^T in [0, pi], which is the identity where measurements are exact.

    Parameters
    ----------
    rotations
        (m, 3, 3) measured on the edges.
    triangles
        (k, 3), see `sample_triangles`.
    """
    ij, jk, ik = triangles.T
    return so3.angle_between(rotations[ij] @ rotations[jk], rotations[ik])


def _place(keys: NDArray[np.int64], wanted: NDArray[np.int64]) -> NDArray[np.intp]:
    """Where sorted keys hold what is wanted; -1 where they do not."""
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return np.where(keys[place] == wanted, place, -1)
