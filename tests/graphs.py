"""Simulated problems that several test files use."""

import numpy as np

from bench.core import so3
from bench.core.problem import Floats, Ints, Problem, oriented


def random_edges(n: int, share: float, seed: int = 0) -> Ints:
    """A path through all cameras, so that the graph is connected, and a share of all other pairs."""
    i, j = np.triu_indices(n, 1)
    kept = (np.random.default_rng(seed).random(len(i)) < share) | (j == i + 1)
    return np.stack([i[kept], j[kept]], axis=1, dtype=np.int32)


def grid_edges(rows: int, columns: int) -> Ints:
    """A rectangular grid: long, with a small spectral gap."""
    label = np.arange(rows * columns).reshape(rows, columns)
    across = np.stack([label[:, :-1].ravel(), label[:, 1:].ravel()], axis=1)
    down = np.stack([label[:-1].ravel(), label[1:].ravel()], axis=1)
    return np.concatenate([across, down]).astype(np.int32)


def simulated(edges: Ints, noise_deg: float = 0.0, outliers: float = 0.0, seed: int = 0) -> tuple[Problem, Floats]:
    """Measurements on a graph, a share of them Haar-uniform, and the true rotations (n, 3, 3)."""
    rng = np.random.default_rng(seed)
    n, m = int(edges.max()) + 1, len(edges)
    truth = so3.random(rng, n)
    i, j = edges.T
    noise = so3.exp(np.radians(noise_deg) * rng.standard_normal((m, 3)))
    measured = truth[i] @ np.swapaxes(truth[j], -1, -2) @ noise
    outlying = rng.random(m) < outliers
    measured[outlying] = so3.random(rng, int(outlying.sum()))
    return Problem(n, edges, measured), truth


def transformed(problem: Problem, seed: int = 0) -> tuple[Problem, Ints]:
    """The problem with cameras relabelled (so edges reversed) and edges permuted; new k is old order[k]."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(problem.n)
    label = np.argsort(order)
    edges, rotations = oriented(label[problem.edges], problem.rotations)
    shuffle = rng.permutation(problem.m)
    weights = None if problem.weights is None else problem.weights[shuffle]
    return Problem(problem.n, edges[shuffle], rotations[shuffle], weights), order.astype(np.int32)


def errors_deg(estimate: Floats, truth: Floats) -> Floats:
    """Errors (n,) in degrees after alignment by the geodesic median."""
    gauge = so3.geodesic_median(np.swapaxes(estimate, -1, -2) @ truth)
    return np.degrees(so3.angle_between(estimate @ gauge, truth))
