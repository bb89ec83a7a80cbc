"""What a graph can tell of its own measurements: which edges lie in a loop, and which in a triangle.

An edge in no loop (a bridge) is fitted exactly by any estimate that follows it: its residual is zero whatever was
measured. An edge in no triangle is not seen by what looks at triangles.
"""

import numpy as np
from numpy.typing import NDArray

from bench.core.problem import Problem

Mask = NDArray[np.bool_]

_BITSETS = 1 << 28  # bytes; where the adjacency takes more as bits, the graph is sparse enough for a product


def in_no_loop(problem: Problem) -> Mask:
    """(m,) True on bridges: edges without which their ends would not be connected. Two parallel edges are a loop.

    Every edge outside a spanning forest gets a random word of 64 bits. The exclusive or of the words at the cameras
    of a subtree is that of the edges that leave it, and is zero where the edge above it is the only one; elsewhere it
    is zero with a probability of 2^-64.
    """
    from scipy import sparse
    from scipy.sparse.csgraph import breadth_first_order

    n = problem.n
    key, first = np.unique(_keys(problem), return_index=True)
    _, root = np.unique(problem.components, return_index=True)
    i, j = np.concatenate([key // n, root]), np.concatenate([key % n, np.full(len(root), n)])  # n: above all roots
    graph = sparse.coo_array((np.ones(len(i)), (i, j)), shape=(n + 1, n + 1)).tocsr()
    order, parent = breadth_first_order(graph, n, directed=False)
    order, up = order[1:], parent[order[1:]]
    low, high = np.minimum(order, up).astype(np.int64), np.maximum(order, up)
    place = np.searchsorted(key, low * n + high)
    tree = np.where(high < n, first[np.minimum(place, len(first) - 1)], -1)  # the edge above each camera in `order`

    words = np.random.default_rng(0).integers(0, 2**64, problem.m, dtype=np.uint64)
    words[tree[tree >= 0]] = 0
    crossing = np.zeros(n + 1, dtype=np.uint64)
    for ends in problem.edges.T:
        np.bitwise_xor.at(crossing, ends, words)
    sums: list[int] = crossing.tolist()
    for camera, above in zip(order[::-1].tolist(), up[::-1].tolist(), strict=True):
        sums[above] ^= sums[camera]
    alone = np.array([sums[camera] == 0 for camera in order.tolist()])
    bridges = np.zeros(problem.m, dtype=bool)
    bridges[tree[alone & (tree >= 0)]] = True
    return bridges


def in_no_triangle(problem: Problem) -> Mask:
    """(m,) True on edges whose ends have no neighbour in common."""
    n = problem.n
    key, inverse = np.unique(_keys(problem), return_inverse=True)
    i, j = key // n, key % n
    if n * n <= 8 * _BITSETS:
        bits = np.zeros((n, (n + 63) // 64), dtype=np.uint64)
        for one, other in ((i, j), (j, i)):
            np.bitwise_or.at(bits, (one, other // 64), np.uint64(1) << (other % 64).astype(np.uint64))
        chunk = max(1, (1 << 21) // bits.shape[1])
        shared = [(bits[i[k : k + chunk]] & bits[j[k : k + chunk]]).any(axis=1) for k in range(0, len(key), chunk)]
        return np.asarray(~np.concatenate(shared)[inverse])
    from scipy import sparse

    upper = sparse.coo_array((np.ones(len(key)), (i, j)), shape=(n, n)).tocsr()
    graph = upper + upper.T
    return np.asarray(np.asarray((graph @ graph)[i, j]).ravel() == 0)[inverse]


def loops_told(problem: Problem) -> str | None:
    """How many edges nothing checks, in a sentence; None where every edge lies in a loop."""
    bridges = int(in_no_loop(problem).sum())
    if not bridges:
        return None
    if bridges == problem.m:
        what = "forest" if problem.components.any() else "tree"
        return (
            f"the graph is a {what}: 0 of {problem.m} edges lie in a loop, so that nothing checks the measurements and "
            "the residual tells nothing of the rotations"
        )
    lie = "lies" if bridges == 1 else "lie"
    return f"{bridges} of {problem.m} edges {lie} in no loop (bridges): nothing checks them"


def triangles_told(problem: Problem) -> str | None:
    """How many edges are in no triangle, in a sentence; None where every edge is in one."""
    outside = int(in_no_triangle(problem).sum())
    return f"{outside} of {problem.m} edges in no triangle" if outside else None


def _keys(problem: Problem) -> NDArray[np.int64]:
    return problem.edges[:, 0].astype(np.int64) * problem.n + problem.edges[:, 1]
