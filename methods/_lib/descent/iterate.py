"""An iterate of a descent over the rotations of all cameras."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, Ints, Problem, so3

from ..loops import edge_kernels

SMALLEST_WEIGHT = 1e-10  # relative to the largest


@dataclass(frozen=True, eq=False)
class Iterate:
    """Rotations of the cameras, with the residuals of the edges there.

    Parameters
    ----------
    edges
        (m, 2).
    measured, cameras
        (m, 4) and (n, 4): R_ij and R_i as unit quaternions.
    vectors, angles
        b_ij (m, 3), where exp(b_ij) = R_i^T R_ij R_j, and their norms (m,), radians.
    """

    edges: Ints
    measured: Floats
    cameras: Floats
    vectors: Floats
    angles: Floats

    @classmethod
    def at(cls, problem: Problem, rotations: Floats) -> "Iterate":
        """Where the cameras have `rotations` (n, 3, 3)."""
        return _measured(problem.edges, so3.to_quaternion(problem.rotations), so3.to_quaternion(rotations))

    def turned(self, steps: Floats) -> "Iterate":
        """Where every camera is R_i exp(x_i), the x_i (n, 3) being `steps`."""
        cameras = self.cameras.copy()
        edge_kernels.turn(steps, cameras)
        return _measured(self.edges, self.measured, cameras)

    @property
    def rotations(self) -> Floats:
        """(n, 3, 3)."""
        return so3.from_quaternion(self.cameras)


def mean_norm(steps: Floats) -> float:
    """Mean length of the steps (n, 3)."""
    return float(np.linalg.norm(steps, axis=1).mean())


def floored(weights: Floats) -> Floats:
    """The weights (m,), none below 1e-10 of the largest: losses that reject edges could disconnect the graph.

    Where every edge is rejected all count the same.
    """
    return np.maximum(weights, SMALLEST_WEIGHT * (weights.max() or 1.0))


def _measured(edges: Ints, measured: Floats, cameras: Floats) -> Iterate:
    """The iterate with these `cameras` (n, 4); shapes as in `Iterate`."""
    vectors, angles = np.empty((len(edges), 3)), np.empty(len(edges))
    edge_kernels.edge_residuals(edges, measured, cameras, vectors, angles)
    return Iterate(edges, measured, cameras, vectors, angles)
