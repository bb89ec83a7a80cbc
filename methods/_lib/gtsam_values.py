"""Rotations as GTSAM's values. Its keys are the camera-to-world rotations S_i = R_i^T."""

from typing import Any

import numpy as np

from bench import Floats


def values_of(rotations: Floats) -> Any:
    """GTSAM's Values with the rotations (n, 3, 3) at the keys 0 to n - 1."""
    import gtsam

    values = gtsam.Values()
    for camera, rotation in enumerate(rotations):
        values.insert(camera, gtsam.Rot3(np.ascontiguousarray(rotation.T)))
    return values


def rotations_of(values: Any, n: int) -> Floats:
    """Rotations (n, 3, 3) at the keys 0 to n - 1 of GTSAM's Values."""
    return np.array([values.atRot3(camera).matrix().T for camera in range(n)])
