"""What a law draws for a graph before it says how large errors are."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints, so3

from .sizes import OUTLIER_DEG

_CHUNK = 1 << 19  # edges at a time, so that memory beyond the results stays bounded


@dataclass(frozen=True, eq=False)
class Draw:
    """Cameras, and the quality and directions of the errors of edges.

    Parameters
    ----------
    smooth
        (n,) function on the cameras that differs little between neighbours.
    truth, seen
        (n, 3, 3): the cameras, and as their edges agree that they are.
    edges
        (m, 2).
    quality
        (m,); the larger, the larger the error.
    directions, outlying
        (m, 3) unit vectors about which edges are wrong: by up to 20 degrees, and by more.
    noise
        (m, 3) rotation vectors of what edges are wrong besides.
    """

    smooth: Floats
    truth: Floats
    seen: Floats
    edges: Ints
    quality: Floats
    directions: Floats
    outlying: Floats
    noise: Floats

    def measured(self, sizes: Floats, chosen: slice | NDArray[np.intp]) -> Floats:
        """Rotations (k, 3, 3) measured on chosen edges, where all (m,) are wrong by angles `sizes`, radians."""
        size = sizes[chosen, None]
        directions = np.where(size > np.radians(OUTLIER_DEG), self.outlying[chosen], self.directions[chosen])
        return so3.exp(size * directions + self.noise[chosen]) @ relative(self.seen, self.edges[chosen])


def relative(rotations: Floats, edges: Ints) -> Floats:
    """R_i R_j^T (k, 3, 3) on edges (k, 2) of cameras (n, 3, 3)."""
    i, j = edges.T
    return rotations[i] @ np.swapaxes(rotations[j], -1, -2)


def units(vectors: Floats) -> Floats:
    """Vectors (k, 3) of length 1, or 0 where they are."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0, lengths, 1.0)


def chunks(m: int) -> list[slice]:
    """Slices that cover 0 to m - 1, none of them long."""
    return [slice(start, start + _CHUNK) for start in range(0, m, _CHUNK)]
