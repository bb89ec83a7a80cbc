"""Unit quaternions (..., 4), scalar first, in torch; `quaternions` computes the same."""

import torch
from torch import Tensor


def product(p: Tensor, q: Tensor) -> Tensor:
    """Hamilton products p q: the quaternions of the products of the rotations."""
    a, b, c, d = p.unbind(-1)
    w, x, y, z = q.unbind(-1)
    return torch.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        dim=-1,
    )


def inverse(q: Tensor) -> Tensor:
    """The quaternions of the transposed rotations."""
    return q * q.new_tensor([1, -1, -1, -1])


def positive(q: Tensor) -> Tensor:
    """Of the two quaternions of each rotation, the one whose scalar is not negative."""
    return torch.where(q[..., :1] < 0, -q, q)


def unit(q: Tensor) -> Tensor:
    """The quaternions divided by their norms."""
    return q / torch.linalg.vector_norm(q, dim=-1, keepdim=True)
