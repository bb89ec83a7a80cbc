"""The measurements as each camera sees them: its neighbours j with R_kj, in consecutive memory."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, Ints, Problem


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Rows ``first[k]`` to ``first[k + 1]`` belong to camera k.

    Parameters
    ----------
    first
        (n + 1,).
    cameras
        (2m,) the neighbours, ascending for each camera.
    rotations
        (2m, 3, 3) R_kj.
    """

    first: Ints
    cameras: Ints
    rotations: Floats


def neighbours_of(problem: Problem) -> Neighbours:
    """Every edge twice, once from each of its ends."""
    from scipy import sparse

    i, j = problem.edges.T
    rows, columns = np.concatenate([i, j]), np.concatenate([j, i])
    order = sparse.csr_array((np.arange(2 * problem.m), (rows, columns)), shape=(problem.n, problem.n))
    order.sort_indices()
    both = np.concatenate([problem.rotations, np.swapaxes(problem.rotations, -1, -2)])
    return Neighbours(order.indptr.astype(np.int32), order.indices.astype(np.int32), both[order.data])
