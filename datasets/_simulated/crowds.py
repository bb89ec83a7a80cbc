"""Who sees what whom sees: topologies like those of pieces of photo collections."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints

_TURNED_DEG = 45.0  # between the axes of two views that match e times less for it
_EVEN = 375.0  # cameras of a collection of which half of the pairs are edges, in the median
_THINNING = 0.75  # power of the number of cameras by which the odds of a pair fall
_ODDS = 1.5  # standard deviation of the logarithm of the odds; 1.15 over twelve collections and their pieces

# From which the parameters of a graph are drawn, the first as they are, the others by their logarithms.
_RANGES = {
    "popularity": (0.2, 1.7),
    "turn": (0.0, 3.0),
    "zoom": (0.2, 1.0),
    "bearing": (0.2, 0.95),
    "poor": (0.05, 0.8),
}
_LOG_RANGES = {"sights": (1.0, 30.0), "extent": (0.5, 25.0), "scatter": (0.05, 1.0), "luck": (0.05, 0.7)}


@dataclass(frozen=True)
class Crowd:
    """Photographs that a crowd took of the sights along a front; lengths are in units of a typical half-view.

    Sights lie anywhere along a front of length `extent` and are log-normal in popularity. A photograph shows the front
    as a window with a normal profile: its centre x is one of the sights, up to `scatter`, its half-width w is
    log-normal with `zoom`, and its axis h points off the normal of the front by `bearing`, where the front itself turns
    by `turn` from end to end. The **match** of photographs i and j is

        log sqrt(2 w_i w_j / s) - (x_i - x_j)^2 / (4 s) - c (1 - cos(h_i - h_j)) - q_i - q_j + luck z_ij

    with s = w_i^2 + w_j^2. The first two terms are the logarithm of what the windows share (their Bhattacharyya
    coefficient), small too where one is much wider than the other; c is such that 45 degrees cost 1; q, exponential
    with mean `poor`, says how bad a photograph is; z is normal. The pairs that match best are edges, as many as the
    mean degree asks for, and what then does not hang together does so by the best pairs between its parts.

    Parameters
    ----------
    sights
        Their number, rounded.
    popularity
        Standard deviation of its logarithm.
    extent, scatter
        Lengths, see above.
    zoom, poor, luck
        See above.
    turn, bearing
        Radians.
    """

    sights: float
    popularity: float
    extent: float
    scatter: float
    zoom: float
    turn: float
    bearing: float
    poor: float
    luck: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "Crowd":
        """From ranges that cover pieces of 60, 100 and 200 cameras of twelve collections."""
        values = {name: float(rng.uniform(*ends)) for name, ends in _RANGES.items()}
        values |= {name: float(np.exp(rng.uniform(*np.log(ends)))) for name, ends in _LOG_RANGES.items()}
        return cls(**values)

    def edges(self, n: int, degree: float, rng: np.random.Generator) -> Ints:
        """Edges (m, 2) of a connected graph of n cameras, i < j, sorted, at a cost linear in the pairs.

        Parameters
        ----------
        degree
            Mean number of edges at a camera; edges that hold the graph together come on top.
        """
        i, j = np.triu_indices(n, 1)
        matches = self._matches(n, i, j, rng)
        chosen = np.zeros(len(i), dtype=bool)
        best = min(len(i), max(1, round(degree * n / 2)))
        chosen[np.argpartition(-matches, best - 1)[:best]] = True
        chosen[_spanning(n, i, j, matches)] = True
        return np.stack([i[chosen], j[chosen]], axis=1).astype(np.int32)

    def _matches(self, n: int, i: NDArray[np.intp], j: NDArray[np.intp], rng: np.random.Generator) -> Floats:
        """How well each pair (i, j) matches, up to a constant."""
        count = round(self.sights)
        popular = np.exp(self.popularity * rng.standard_normal(count))
        at = rng.uniform(0, self.extent, count)[rng.choice(count, n, p=popular / popular.sum())]
        x = at + self.scatter * rng.standard_normal(n)
        w = np.exp(self.zoom * rng.standard_normal(n))
        h = self.turn * x / self.extent + self.bearing * rng.standard_normal(n)
        q = self.poor * rng.standard_exponential(n)
        s = w[i] ** 2 + w[j] ** 2
        shared = 0.5 * np.log(2 * w[i] * w[j] / s) - (x[i] - x[j]) ** 2 / (4 * s)
        turned = (1 - np.cos(h[i] - h[j])) / (1 - np.cos(np.radians(_TURNED_DEG)))
        return np.asarray(shared - turned - q[i] - q[j] + self.luck * rng.standard_normal(len(i)))


def drawn_degree(n: int, rng: np.random.Generator) -> float:
    """A mean degree for n cameras: the odds of a pair to be an edge are (375 / n)^0.75, times log-normal (1.5)."""
    odds = (_EVEN / n) ** _THINNING * np.exp(_ODDS * rng.standard_normal())
    return float((n - 1) * odds / (1 + odds))


def _spanning(n: int, i: NDArray[np.intp], j: NDArray[np.intp], matches: Floats) -> NDArray[np.intp]:
    """Which pairs are the tree that holds all cameras together by the best matches."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import minimum_spanning_tree

    costs = 1 + matches.max() - matches
    start = np.concatenate([[0], np.cumsum(np.arange(n - 1, -1, -1))])
    tree = minimum_spanning_tree(csr_array((costs, j, start), shape=(n, n))).tocoo()
    return np.asarray(start[tree.row] + tree.col - tree.row - 1)
