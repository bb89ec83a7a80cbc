"""What networks are taught: errors as they count, and which edges are right."""

import numpy as np
import torch
from torch import Tensor

from bench import Instance, so3

SMALL_DEG, FAR = 0.5, 0.05
WRONG_DEG = 20.0


def mean_loss(vectors: Tensor) -> Tensor:
    """Mean of log(1 + e / 0.5) + 0.05 e over the lengths e in degrees of rotation vectors (k, 3) in radians.

    It saturates, and is precise where errors are small.
    """
    errors = torch.rad2deg(torch.sqrt((vectors**2).sum(dim=1) + 1e-12))
    return (torch.log1p(errors / SMALL_DEG) + FAR * errors).mean()


def inliers(instance: Instance) -> Tensor:
    """(m,) 1 where an edge is wrong by less than 20 degrees, and 0 elsewhere; the truth must be known."""
    assert instance.truth is not None
    i, j = instance.problem.edges.T
    true = instance.truth[i] @ np.swapaxes(instance.truth[j], 1, 2)
    wrong = so3.angle_between(instance.problem.rotations, true)
    return torch.from_numpy((wrong < np.radians(WRONG_DEG)).astype(np.float32))
