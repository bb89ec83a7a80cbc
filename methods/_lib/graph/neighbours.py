"""The measurements as each camera sees them: its neighbours j with R_kj, in consecutive memory."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, Ints, Problem

from .confidence import confidence


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Rows ``first[k]`` to ``first[k + 1]`` belong to camera k.

    Parameters
    ----------
    first
        (n + 1,).
    cameras
        (2m,) the neighbours, ascending for each camera; one that was measured twice stands twice.
    rotations
        (2m, 3, 3) R_kj.
    weights
        (2m,) the `confidence` of these edges.
    """

    first: Ints
    cameras: Ints
    rotations: Floats
    weights: Floats


def neighbours_of(problem: Problem) -> Neighbours:
    """Every edge twice, once from each of its ends."""
    i, j = problem.edges.T
    rows, columns = np.concatenate([i, j]), np.concatenate([j, i])
    order = np.lexsort((columns, rows))
    first = np.concatenate([[0], np.cumsum(problem.degree)]).astype(np.int32)
    both = np.concatenate([problem.rotations, np.swapaxes(problem.rotations, -1, -2)])
    return Neighbours(first, columns[order], both[order], np.tile(confidence(problem), 2)[order])
