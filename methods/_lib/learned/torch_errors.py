"""What networks are taught: errors as they count, and which edges are right."""

import numpy as np
import torch
from torch import Tensor

from bench import Floats, Instance, so3

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


def left_over(steps: Tensor, cameras: Floats, instance: Instance) -> Tensor:
    """(n, 3) rotation vectors, in radians, by which cameras (n, 4) are off after steps (n, 3) in the world.

    The truth must be known. Its gauge is their geodesic median, and the median of what is left in each coordinate,
    which is differentiated: the mean of the steps means nothing.
    """
    assert instance.truth is not None
    between = np.swapaxes(so3.from_quaternion(cameras), 1, 2) @ instance.truth
    wanted = torch.from_numpy(so3.log(between @ so3.geodesic_median(between).T))
    errors = steps - wanted
    return torch.as_tensor(errors - errors.median(dim=0).values)
