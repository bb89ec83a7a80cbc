"""From relaxed solutions to rotations."""

import numpy as np

from bench.core import so3
from bench.core.problem import Floats


def nearest_rotations(vectors: Floats) -> Floats:
    """Rotations (n, 3, 3) nearest to the blocks of three columns (3n, 3), which are known up to a common O(3).

    Where most blocks are reflections one column changes its sign: the reflection is one for all cameras.
    """
    blocks = vectors.reshape(-1, 3, 3)
    if np.sign(np.linalg.det(blocks)).sum() < 0:
        blocks = blocks * [1.0, 1.0, -1.0]
    return so3.project(blocks)


def rounded(gram: Floats) -> Floats:
    """Rotations (n, 3, 3) nearest to the three leading eigenvectors of a matrix (3n, 3n) close to R R^T."""
    from scipy.linalg import eigh

    size = len(gram)
    values, vectors = eigh(gram, subset_by_index=[size - 3, size - 1])
    return nearest_rotations(vectors * np.sqrt(values))
