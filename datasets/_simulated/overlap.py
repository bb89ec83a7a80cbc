"""How much the neighbourhoods of the two cameras of an edge overlap."""

import numpy as np

from bench import Floats, Ints

_HASHES = 64


def overlap(n: int, edges: Ints, rng: np.random.Generator) -> Floats:
    """(m,) estimates of the Jaccard index of the neighbourhoods of the ends of `edges` (m, 2), each with itself.

    The share of 64 random orders of the cameras in which both neighbourhoods have the same first camera (Broder 1997),
    so that the cost is linear in the edges.
    """
    i, j = edges.T
    loops = np.arange(n)
    owner = np.concatenate([i, j, loops])
    order = np.argsort(owner, kind="stable")
    member = np.concatenate([j, i, loops])[order]
    first = np.searchsorted(owner[order], loops)
    equal = np.zeros(len(edges))
    for _ in range(_HASHES):
        lowest = np.minimum.reduceat(rng.permutation(n)[member], first)
        equal += lowest[i] == lowest[j]
    return equal / _HASHES
