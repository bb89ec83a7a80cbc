"""Cameras as photographers hold them: upright, and looking where their neighbours look."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, Ints, so3

_STEPS = 60  # of smoothing; each costs the edges once


@dataclass(frozen=True)
class Upright:
    """How cameras are turned; degrees.

    Parameters
    ----------
    pan_deg
        Standard deviation over the graph of the part of the pan that neighbours share, which is uniform.
    jitter_deg, tilt_deg, roll_deg
        Standard deviations of the pan, tilt and roll that are a camera's own.
    """

    pan_deg: float = 25.0
    jitter_deg: float = 14.0
    tilt_deg: float = 9.0
    roll_deg: float = 3.0

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "Upright":
        """From the ranges of the law of correlated errors."""
        low, high = np.array([[10, 7, 4, 1], [50, 25, 14, 6]])
        return cls(*rng.uniform(low, high).tolist())

    def rotations(self, smooth: Floats, rng: np.random.Generator) -> Floats:
        """Rotations (n, 3, 3) world to camera, x right, y up: the world is panned about y, then tilted, then rolled.

        Parameters
        ----------
        smooth
            (n,) function whose ranks the shared part of the pan follows.
        """
        own = rng.standard_normal((3, len(smooth)))
        ranks = np.argsort(np.argsort(smooth))
        pan = self.pan_deg * np.sqrt(12) * (ranks / len(smooth) - 0.5) + self.jitter_deg * own[0]
        turns = zip((pan, self.tilt_deg * own[1], self.roll_deg * own[2]), np.eye(3)[[1, 0, 2]], strict=True)
        about_y, about_x, about_z = (so3.exp(np.radians(angle)[:, None] * axis) for angle, axis in turns)
        return about_z @ about_x @ about_y


def smooth_function(n: int, edges: Ints, rng: np.random.Generator) -> Floats:
    """(n,) function on the cameras, of mean 0 and variance 1, that differs little between neighbours.

    White noise after 60 steps of a lazy random walk, with the constant taken out: a mixture of the smoothest
    eigenvectors of the normalised Laplacian, at a cost linear in the edges.
    """
    from scipy.sparse import coo_array

    i, j = edges.T
    graph = coo_array((np.ones(len(edges)), (i, j)), shape=(n, n)).tocsr()
    graph = graph + graph.T
    degree = graph.sum(axis=1)
    inverse = 1 / np.maximum(degree, 1)
    x = rng.standard_normal(n)
    for _ in range(_STEPS):
        x = 0.5 * (x + inverse * (graph @ x))
        x -= degree @ x / degree.sum()
        x /= np.sqrt(degree @ x**2 / degree.sum()) or 1.0
    x -= x.mean()
    return np.asarray(x / (x.std() or 1.0))
