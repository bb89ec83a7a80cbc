"""From relaxed solutions to rotations."""

import numpy as np

from bench import Floats, so3


def nearest_rotations(vectors: Floats) -> Floats:
    """Rotations (n, 3, 3) nearest to the blocks of three columns (3n, 3), which are known up to a common O(3).

    Where most blocks are reflections one column changes its sign: the reflection is one for all cameras.
    """
    blocks = vectors.reshape(-1, 3, 3)
    if np.sign(np.linalg.det(blocks)).sum() < 0:
        blocks = blocks * [1.0, 1.0, -1.0]
    return so3.project(blocks)


def note_on_mirrored(vectors: Floats) -> tuple[str, ...]:
    """What to say where some blocks of three columns (3n, 3) are reflections and others are not."""
    signs = np.sign(np.linalg.det(vectors.reshape(-1, 3, 3)))
    count, n = int(min((signs > 0).sum(), (signs < 0).sum())), len(signs)
    return (f"not converged: {count} of {n} cameras were fitted as mirror images of the others",) if count else ()


def rounded(gram: Floats) -> Floats:
    """Rotations (n, 3, 3) nearest to the three leading eigenvectors of a matrix (3n, 3n) close to R R^T."""
    values, vectors = np.linalg.eigh(gram)
    return nearest_rotations(vectors[:, -3:] * np.sqrt(values[-3:]))
