"""Pieces of a topology, as large as one wants."""

import numpy as np

from bench import Ints


def piece(n: int, edges: Ints, cameras: int, rng: np.random.Generator) -> tuple[int, Ints]:
    """The graph that a breadth-first search has seen when it has met so many cameras: connected, as dense as the whole.

    The search starts at a random camera of the largest component and meets neighbours in random order; of a component
    that is smaller than the piece there is all. The cost is linear in the edges, whatever the piece.

    Parameters
    ----------
    n
        Cameras of the whole graph.
    edges
        (m, 2), i < j.
    cameras
        Of the piece.

    Returns
    -------
    tuple
        The number of cameras, and the edges (k, 2) among them, i < j. Cameras and edges keep their order.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    shuffled = rng.permutation(n).astype(np.int32)  # neighbours are met in the order of their labels
    i, j = shuffled[edges].T
    ends = np.concatenate([i, j]), np.concatenate([j, i])
    graph = coo_array((np.ones(2 * len(edges), dtype=np.int8), ends), shape=(n, n)).tocsr()
    _, component = connected_components(graph, directed=False)
    largest = np.flatnonzero(component == np.bincount(component).argmax())
    met = breadth_first_order(graph, rng.choice(largest), return_predecessors=False)
    chosen = np.zeros(n, dtype=bool)
    chosen[met[:cameras]] = True
    chosen = chosen[shuffled]
    label = np.cumsum(chosen, dtype=np.int32) - 1
    kept = chosen[edges[:, 0]] & chosen[edges[:, 1]]
    return int(chosen.sum()), label[edges[kept]]
