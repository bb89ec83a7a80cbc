"""Shapes of small graphs: each function returns the edges (m, 2), i < j, of a graph on n cameras."""

import numpy as np

from bench import Ints

from .graphs import connected_graph


def path(n: int) -> Ints:
    """A chain: a tree, in which nothing is checked by anything."""
    return _pairs(np.arange(n - 1), np.arange(1, n))


def star(n: int) -> Ints:
    """One camera that all others are joined to."""
    return _pairs(np.zeros(n - 1), np.arange(1, n))


def ring(n: int) -> Ints:
    """A chain that closes: one loop."""
    return np.concatenate([path(n), _pairs([0], [n - 1])])


def complete(n: int) -> Ints:
    """Every pair."""
    return _pairs(*np.triu_indices(n, 1))


def random(n: int, probability: float, rng: np.random.Generator) -> Ints:
    """An Erdős–Rényi graph that is connected."""
    return connected_graph(n, probability, rng, "a larger probability")


def sequence(n: int, reach: int, closures: int, rng: np.random.Generator) -> Ints:
    """A video: every camera sees the next few, and some see one much earlier."""
    near = [_pairs(np.arange(n - k), np.arange(k, n)) for k in range(1, reach + 1)]
    early = rng.choice(n // 3, closures, replace=False)
    late = n - 1 - rng.choice(n // 3, closures, replace=False)
    return np.concatenate([*near, _pairs(early, late)])


def grid(rows: int, columns: int) -> Ints:
    """A rectangular grid."""
    label = np.arange(rows * columns).reshape(rows, columns)
    across = _pairs(label[:, :-1].ravel(), label[:, 1:].ravel())
    return np.concatenate([across, _pairs(label[:-1].ravel(), label[1:].ravel())])


def ladder(n: int) -> Ints:
    """Two chains side by side: long and thin, so that the second eigenvalue of the Laplacian is nearly zero."""
    return grid(n // 2, 2)


def beside(first: Ints, second: Ints, bridges: int = 0) -> Ints:
    """Two graphs, the second with the ids that follow, joined by edges between their k-th cameras."""
    shift = int(first.max()) + 1
    joints = np.arange(bridges)
    return np.concatenate([first, second + np.int32(shift), _pairs(joints, shift + joints)])


def _pairs(i: "np.typing.ArrayLike", j: "np.typing.ArrayLike") -> Ints:
    return np.stack([np.asarray(i), np.asarray(j)], axis=1).astype(np.int32)
