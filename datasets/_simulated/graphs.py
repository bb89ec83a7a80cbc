"""Random graphs that hang together."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bench import InputError, Ints

_ATTEMPTS = 1000


def connected_graph(
    n: int,
    probability: float | NDArray[np.float64],
    rng: np.random.Generator,
    advice: str,
    usable: Callable[[Ints], bool] = lambda edges: True,
) -> Ints:
    """Edges (m, 2) of the first graph drawn that is connected and `usable`.

    Parameters
    ----------
    n
        Cameras.
    probability
        Of each pair i < j, in the order of ``np.triu_indices``: one for all, or (n (n - 1) / 2,).
    advice
        What to choose instead, where a thousand draws give none.

    Raises
    ------
    InputError
        Where they do.
    """
    i, j = np.triu_indices(n, 1)
    for _ in range(_ATTEMPTS):
        kept = rng.random(len(i)) < probability
        edges = np.stack([i[kept], j[kept]], axis=1).astype(np.int32)
        if pieces(edges, n) == 1 and usable(edges):
            return edges
    raise InputError(f"none of {_ATTEMPTS} random graphs with n={n} is connected; choose {advice}")


def pieces(edges: Ints, n: int) -> int:
    """Number of connected components of the graph of `edges` (m, 2) on n cameras."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    return int(connected_components(graph, directed=False)[0])
