"""Errors as the networks that refine are taught to see them: saturating, and precise where they are small."""

import torch
from torch import Tensor

SMALL_DEG, FAR = 0.5, 0.05


def mean_loss(vectors: Tensor) -> Tensor:
    """Mean of log(1 + e / 0.5) + 0.05 e over the lengths e in degrees of rotation vectors (k, 3) in radians."""
    errors = torch.rad2deg(torch.sqrt((vectors**2).sum(dim=1) + 1e-12))
    return (torch.log1p(errors / SMALL_DEG) + FAR * errors).mean()
