"""The quadratic program of DESC, by projected gradient descent on a product of simplices."""

import numpy as np

from bench import Floats, Ints

from ..graph.triangles import Triangles
from ..loops.edge_kernels import compiled


def consistent_levels(triangles: Triangles, rate: float, iterations: int) -> Floats:
    """Corruption levels s (m,) of the edges, s_ij = sum_k w_ij,k d_ij,k, after descending on the objective of `DESC`.

    The w of an edge stay on the simplex, where they start equal. The derivative with respect to w_ij,k is
    s_ik + s_jk + c_ij d_ij,k, c_ij being the sum of the w of all triangles that have edge ij as a side. An edge in no
    triangle has s = 1.
    """
    m, most = triangles.inconsistency.shape
    shares = np.repeat(1 / np.maximum(triangles.counts, 1.0)[:, None], most, axis=1)
    state = np.empty((m, 2))  # s and c of each edge
    following = np.empty((m, 2))
    _descend(triangles.counts, triangles.sides, triangles.inconsistency, 0.0, following, shares, state)
    for _ in range(iterations):
        _descend(triangles.counts, triangles.sides, triangles.inconsistency, rate, state, shares, following)
        state, following = following, state
    return state[:, 0].copy()


@compiled
def _descend(
    counts: Ints, sides: Ints, inconsistency: Floats, rate: float, state: Floats, shares: Floats, following: Floats
) -> None:
    """One step from `shares` (m, k), changed in place, given the (s, c) of each edge there; `following` is filled.

    The nearest point of the simplex is max(w - t, 0); t is found by leaving out what is below it (Michelot 1986).
    """
    following[:] = 0
    for e in range(counts.shape[0]):
        count = counts[e]
        if count == 0:
            following[e, 0] = 1
            continue
        total = 0.0
        for t in range(count):
            if rate > 0:
                slope = state[sides[e, t, 0], 0] + state[sides[e, t, 1], 0] + state[e, 1] * inconsistency[e, t]
                shares[e, t] -= rate * slope
            total += shares[e, t]
        threshold = (total - 1) / count
        remaining, previous = count, count + 1
        while remaining < previous:
            previous, remaining, total = remaining, 0, 0.0
            for t in range(count):
                if shares[e, t] > threshold:
                    remaining += 1
                    total += shares[e, t]
            threshold = (total - 1) / remaining
        level = 0.0
        for t in range(count):
            share = max(shares[e, t] - threshold, 0.0)
            shares[e, t] = share
            level += share * inconsistency[e, t]
            following[sides[e, t, 0], 1] += share
            following[sides[e, t, 1], 1] += share
        following[e, 0] = level
