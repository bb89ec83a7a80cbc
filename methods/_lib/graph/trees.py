"""Spanning trees of the measured edges, and rotations propagated along them."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints, Problem, so3

if TYPE_CHECKING:
    from scipy import sparse

EdgeIds = NDArray[np.intp]


def tree_rotations(problem: Problem, weights: Floats | None = None) -> Floats:
    """Rotations (n, 3, 3) along the tree of largest total `weights` (m,), or along the breadth-first tree."""
    return propagated(problem, tree_edges(problem, weights))


def tree_edges(problem: Problem, weights: Floats | None) -> EdgeIds:
    """Edges (n - 1,) of the tree that `SpanningTree` describes, for a connected problem."""
    return _breadth_first_tree(problem) if weights is None else _heaviest_tree(problem, weights)


def propagated(problem: Problem, tree: EdgeIds) -> Floats:
    """Rotations (n, 3, 3) that fit the edges of `tree` exactly, from the camera of highest degree."""
    root = hub(problem)
    parent, depth = _search(problem, tree, root)
    i, j = problem.edges[tree].T
    upward = parent[i] == j
    from_parent = np.empty((problem.n, 3, 3))
    from_parent[i[upward]] = problem.rotations[tree[upward]]
    from_parent[j[~upward]] = np.swapaxes(problem.rotations[tree[~upward]], -1, -2)
    rotations = np.empty((problem.n, 3, 3))
    rotations[root] = np.eye(3)
    by_depth = np.argsort(depth, kind="stable")
    for level in np.split(by_depth, np.flatnonzero(np.diff(depth[by_depth])) + 1)[1:]:
        rotations[level] = from_parent[level] @ rotations[parent[level]]
    return rotations


def hub(problem: Problem) -> int:
    """Camera of highest degree, of several the one whose measurements have the smallest angles."""
    best = np.flatnonzero(problem.degree == problem.degree.max())
    if len(best) > 1:
        angles = so3.angle(problem.rotations)
        totals = np.bincount(problem.edges.ravel(), np.repeat(angles, 2))
        best = best[np.argsort(totals[best], kind="stable")]
    return int(best[0])


def _heaviest_tree(problem: Problem, weights: Floats) -> EdgeIds:
    """Minimum spanning tree (n - 1,) of the ranks of `weights` (m,), all different, so that there is only one."""
    from scipy.sparse.csgraph import minimum_spanning_tree

    by_rank = np.lexsort((so3.angle(problem.rotations), -weights))
    ranks = np.empty(problem.m)
    ranks[by_rank] = np.arange(1, problem.m + 1)
    pairs = problem.edges[by_rank, 0].astype(np.int64) * problem.n + problem.edges[by_rank, 1]
    best = by_rank[np.unique(pairs, return_index=True)[1]]  # of parallel edges
    tree = minimum_spanning_tree(_upper(problem, best, ranks[best]))
    chosen: EdgeIds = by_rank[tree.data.astype(np.intp) - 1]
    return chosen


def _breadth_first_tree(problem: Problem) -> EdgeIds:
    """Edges (n - 1,): of those that lead one level up from a camera, the one to the highest degree."""
    _, depth = _search(problem, np.arange(problem.m), hub(problem))
    difference = np.diff(depth[problem.edges], axis=1)[:, 0]
    candidates = np.flatnonzero(difference)
    i, j = problem.edges[candidates].T
    child, parent = np.where(difference[candidates] > 0, (j, i), (i, j))
    highest = np.zeros(problem.n, dtype=problem.degree.dtype)
    np.maximum.at(highest, child, problem.degree[parent])
    kept = np.flatnonzero(problem.degree[parent] == highest[child])
    candidates, child = candidates[kept], child[kept]
    order = np.lexsort((so3.angle(problem.rotations[candidates]), child))
    _, first = np.unique(child[order], return_index=True)
    return candidates[order[first]]


def _search(problem: Problem, chosen: EdgeIds, root: int) -> tuple[Ints, Ints]:
    """Parents (n,), negative at the root, and depths (n,) of a breadth-first search of the `chosen` edges."""
    from scipy.sparse.csgraph import breadth_first_order

    graph = _upper(problem, chosen, np.ones(len(chosen)))  # parallel edges add up
    order, parent = breadth_first_order(graph, root, directed=False)
    above, depth = parent.tolist(), [0] * problem.n
    for camera in order[1:].tolist():
        depth[camera] = depth[above[camera]] + 1
    return parent, np.array(depth, dtype=np.int32)


def _upper(problem: Problem, chosen: EdgeIds, values: Floats) -> "sparse.csr_array":
    """Matrix (n, n) of `values` (k,) on the edges `chosen` (k,), above the diagonal."""
    from scipy import sparse

    i, j = problem.edges[chosen].T
    return sparse.csr_array((values, (i, j)), shape=(problem.n, problem.n))
