"""Parallel edges made one: for algorithms that truly need a simple graph."""

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.problem import Floats, Problem

SWEEPS = 200
SETTLED = 1e-12  # radians
_TINY = 1e-12  # radians; a measurement that the median sits on keeps a finite weight


def fused(problem: Problem) -> tuple[Problem, NDArray[np.intp]]:
    """Measure every pair once: by the geodesic median of its measurements, their weights and precisions added.

    The weighted L1 median is found by Weiszfeld's iteration in the tangent space (Hartley, Aftab and Trumpf 2011) from
    the chordal mean, which is kept where two measurements weigh the same: all rotations between them are medians.

    Returns
    -------
    The problem on the simple graph, its edges in lexicographic order, and for each given edge (m,) its new one.
    """
    key = problem.edges[:, 0].astype(np.int64) * problem.n + problem.edges[:, 1]
    _, first, pair = np.unique(key, return_index=True, return_inverse=True)
    weights = np.ones(problem.m) if problem.weights is None else problem.weights
    added = None if problem.precisions is None else _sums(problem.precisions, pair)
    simple = Problem(
        problem.n,
        problem.edges[first],
        _medians(problem.rotations, weights, pair),
        None if problem.weights is None else _sums(weights, pair),
        problem.weights_kind,
        added,
        problem.gravity,
    )
    return simple, pair


def _medians(rotations: Floats, weights: Floats, group: NDArray[np.intp]) -> Floats:
    medians = so3.project(_sums(weights[:, None, None] * rotations, group))
    for _ in range(SWEEPS):
        away = so3.log(rotations @ np.swapaxes(medians[group], -1, -2))
        pull = weights / np.maximum(np.linalg.norm(away, axis=1), _TINY)
        steps = _sums(pull[:, None] * away, group) / _sums(pull, group)[:, None]
        medians = so3.exp(steps) @ medians
        if np.linalg.norm(steps, axis=1).max() < SETTLED:
            break
    return so3.project(medians)


def _sums(values: Floats, group: NDArray[np.intp]) -> Floats:
    sums = np.zeros((int(group.max()) + 1, *values.shape[1:]))
    np.add.at(sums, group, values)
    return sums
