"""Reweighted least squares over the rotations of all cameras, which move at every step."""

from collections.abc import Callable

import numpy as np

from bench import Floats, Problem

from ..graph.confidence import confidence
from ..linear.laplacian import LaplacianSolver
from ..loops import edge_kernels
from .iterate import floored
from .losses import Loss

SLOW = 0.5  # mean step, relative to the one before, above which a stage creeps
RELAXATION = 1.5  # factor of the steps of a stage that creeps
LINEAR_TOLERANCE = 0.03  # of the least squares problems of large graphs; the next iteration corrects the rest


class Descent:
    """Cameras that move, with the residuals of the edges where they are now.

    `cameras` (n, 4) are unit quaternions, `angles` (m,) and `vectors` (m, 3) the residuals in radians.
    """

    def __init__(self, problem: Problem, start: Floats, tolerance: float) -> None:
        self.iterations = 0
        self.cameras = _quaternions(start)
        self.angles = np.empty(problem.m)
        self.vectors = np.empty((problem.m, 3))
        self._tolerance = tolerance
        self._edges = problem.edges
        self._measured = _quaternions(problem.rotations)
        self._confidence = confidence(problem)
        self._laplacian = LaplacianSolver(problem, LINEAR_TOLERANCE)
        self._measure()

    def weights(self, loss: Loss, scale: float) -> Floats:
        """(m,) how much each edge counts here: its confidence times the weight of its loss."""
        return self._confidence * loss.weight(self.angles / scale)

    def reweight(self, loss: Loss, scale: float, limit: int) -> bool:
        """Iterate with the weights of `loss`; whether the mean step fell below the tolerance in time."""
        length = np.inf
        for _ in range(limit):
            length = self.step(floored(self.weights(loss, scale)), SLOW * length)
            if length < self._tolerance:
                return True
        return False

    def step(self, weights: Floats, longest: float = np.inf, errors: Floats | None = None) -> float:
        """Move every camera to the minimum of the problem linearised with `weights` (m,); the mean step in radians.

        Where that is above `longest`, the cameras move on beyond the minimum, by `RELAXATION`. `errors` (m, 3) of the
        measurements, as far as they are known, are taken off the residuals.
        """
        steps = self._laplacian.solve(weights, self.vectors if errors is None else self.vectors - errors)
        length = float(np.sqrt(np.einsum("ij,ij->i", steps, steps)).mean())
        if length > longest:
            steps *= RELAXATION
        edge_kernels.turn(steps, self.cameras)
        self.iterations += 1
        self._measure()
        return length

    def inverse(self, weights: Floats) -> Callable[[Floats], Floats]:
        """Return the inverse of the normal matrix of `weights` (m,); see `LaplacianSolver.inverse`."""
        return self._laplacian.inverse(weights)

    def move_to(self, cameras: Floats) -> None:
        """Put the cameras elsewhere, at quaternions (n, 4)."""
        self.cameras[:] = cameras
        self._measure()

    def _measure(self) -> None:
        edge_kernels.edge_residuals(self._edges, self._measured, self.cameras, self.vectors, self.angles)


def _quaternions(rotations: Floats) -> Floats:
    """Unit quaternions (k, 4) of rotations (k, 3, 3)."""
    result = np.empty((len(rotations), 4))
    edge_kernels.quaternions(rotations, result)
    return result
