"""Who sees what whom sees: topologies like those of photographs taken along a street or around a square."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints

_NEEDED = 0.5  # of the widest view must be shared
_MATCHED = 0.9  # of the pairs that share so much
_SAMPLE = 400  # cameras that the mean degree is measured on
_HALVINGS = 30


@dataclass(frozen=True)
class Street:
    """Cameras along a line or a ring, each with the interval of it that it sees.

    Positions have exponential gaps, in places popular to different degrees (log-normal, `clumps`). A camera sees the
    interval of half-width g around its position, in units of the widest, with g between a quarter and 1. Two views that
    share half of the widest are an edge with probability 0.9 s_i s_j, where s is 1, or for a share `hard` of the
    photographs log-uniform between 0.01 and 1. The unit is chosen by the mean degree. What is not connected is then
    joined to its neighbour along the line.

    Parameters
    ----------
    degree
        Mean number of edges at a camera, up to sampling.
    closed
        A ring instead of a line.
    hard, clumps
        See above.
    """

    degree: float
    closed: bool
    hard: float = 0.3
    clumps: float = 0.7

    @classmethod
    def drawn(cls, degree: float, closed: bool, rng: np.random.Generator) -> "Street":
        """From ranges that cover the degrees, relative to their mean, of the sixteen view graphs of 1DSfM and Quad."""
        return cls(degree, closed, *rng.uniform([0.15, 0.3], [0.5, 1.2]).tolist())

    def edges(self, n: int, rng: np.random.Generator) -> Ints:
        """Edges (m, 2) on n cameras in random order, i < j, at a cost linear in the edges."""
        places = max(2, round(2 * n / self.degree))
        popular = np.exp(self.clumps * rng.standard_normal(places))[np.arange(n) * places // n]
        x = np.cumsum(rng.standard_exponential(n) / popular)
        half = _NEEDED / 2 + (1 - _NEEDED / 2) * rng.random(n)
        matched = np.where(rng.random(n) < self.hard, np.exp(rng.uniform(np.log(0.01), 0, n)), 1.0)
        unit = self._unit(x, half, matched, rng)
        found = np.concatenate([*self._pairs(x / unit, half, matched, rng)])
        edges = np.unique(np.sort(np.concatenate([found, _joints(n, found)]), axis=1), axis=0)
        return np.sort(rng.permutation(n)[edges], axis=1).astype(np.int32)

    def _unit(self, x: Floats, half: Floats, matched: Floats, rng: np.random.Generator) -> float:
        """The half-width of the widest view for which the mean degree is right, by bisection of its logarithm."""
        chosen = rng.integers(len(x), size=_SAMPLE)
        low, high = np.log(x[-1] / len(x)) - 3, np.log(x[-1])
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            if self._mean_degree(x / np.exp(middle), half, matched, chosen) < self.degree:
                low = middle
            else:
                high = middle
        return float(np.exp(low))

    def _mean_degree(self, x: Floats, half: Floats, matched: Floats, chosen: NDArray[np.intp]) -> float:
        """Of the cameras chosen, from the views that reach them."""
        reach = 2 - _NEEDED
        first, last = np.searchsorted(x, x[chosen] - reach), np.searchsorted(x, x[chosen] + reach, side="right")
        total = 0.0
        for camera, start, end in zip(chosen.tolist(), first.tolist(), last.tolist(), strict=True):
            sees = _shared(half[camera], half[start:end], np.abs(x[start:end] - x[camera])) >= _NEEDED
            total += matched[camera] * (matched[start:end][sees].sum() - matched[camera])
        return _MATCHED * total / len(chosen)

    def _pairs(self, x: Floats, half: Floats, matched: Floats, rng: np.random.Generator) -> list[Ints]:
        """Edges (k, 2) found at each distance along the line, from the nearest on."""
        n, around = len(x), x[-1] + x[0]
        near, pairs = np.arange(n), [np.empty((0, 2), dtype=np.int32)]
        for step in range(1, (n + 1) // 2 if self.closed else n):
            near = near if self.closed else near[near + step < n]
            other = (near + step) % n
            apart = (x[other] - x[near]) % around
            within = apart <= 2 - _NEEDED
            near, other, apart = near[within], other[within], apart[within]
            if not len(near):
                break
            sees = _shared(half[near], half[other], apart) >= _NEEDED
            kept = sees & (rng.random(len(near)) < _MATCHED * matched[near] * matched[other])
            pairs.append(np.stack([near[kept], other[kept]], axis=1).astype(np.int32))
        return pairs


def _shared(one: Floats, other: Floats, apart: Floats) -> Floats:
    """Length that two intervals of half-widths `one` and `other` have in common, their centres `apart`."""
    return np.minimum(one + other - apart, 2 * np.minimum(one, other))


def _joints(n: int, edges: Ints) -> Ints:
    """Edges (k, 2) between cameras next to each other that lie in different components."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    _, component = connected_components(graph, directed=False)
    apart = np.flatnonzero(component[1:] != component[:-1]).astype(np.int32)
    return np.stack([apart, apart + 1], axis=1)
