"""Unit quaternions (..., 4), scalar first, in numpy; `torch_quaternions` computes the same."""

import numpy as np

from bench import Floats


def product(p: Floats, q: Floats) -> Floats:
    """Hamilton products p q: the quaternions of the products of the rotations."""
    a, b, c, d = np.moveaxis(p, -1, 0)
    w, x, y, z = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        axis=-1,
    )


def inverse(q: Floats) -> Floats:
    """The quaternions of the transposed rotations."""
    return q * np.array([1, -1, -1, -1], q.dtype)


def positive(q: Floats) -> Floats:
    """Of the two quaternions of each rotation, the one whose scalar is not negative."""
    return np.where(q[..., :1] < 0, -q, q)


def unit(q: Floats) -> Floats:
    """The quaternions divided by their norms."""
    return q / np.linalg.norm(q, axis=-1, keepdims=True)
