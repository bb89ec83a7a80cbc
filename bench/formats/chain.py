"""Absolute rotations from relative ones that are exact, as ground truth sometimes comes."""

import numpy as np

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Floats, Problem


def propagated(problem: Problem) -> Floats:
    """Rotations (n, 3, 3) of a connected, noise-free graph, chained along a breadth-first tree.

    Raises
    ------
    InputError
        Where the graph is not connected.
    """
    from scipy.sparse.csgraph import breadth_first_order

    if problem.components.any():
        raise InputError("rotations cannot be propagated over a graph that is not connected")
    order, parent = breadth_first_order(problem.adjacency(), 0, directed=False)
    measured = {(int(i), int(j)): r for (i, j), r in zip(problem.edges, problem.rotations, strict=True)}
    rotations = np.empty((problem.n, 3, 3))
    rotations[0] = np.eye(3)
    for camera in order[1:].tolist():
        from_ = int(parent[camera])
        step = measured[camera, from_] if camera < from_ else measured[from_, camera].T
        rotations[camera] = step @ rotations[from_]
    return so3.project(rotations)  # a thousand products add up their rounding
