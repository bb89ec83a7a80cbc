"""Parts of a scene that hang on to the rest by measurements that are wrong all in the same way."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, Ints, so3


@dataclass(frozen=True)
class Fold:
    """A part whose repeated structure matches that of the rest, so that wrong edges agree with each other.

    Parameters
    ----------
    share
        Fraction of the cameras in the part. They are those where a smooth function on the graph is lowest, so that few
        edges join them to the rest.
    angle_deg
        By which the edges are wrong, about the vertical of the world.
    agreeing
        Fraction of the edges between the part and the rest that are wrong so.
    """

    share: float = 0.1
    angle_deg: float = 30.0
    agreeing: float = 0.5

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "Fold":
        """Of 3 to 20 % of the cameras, by 10 to 60 degrees, with 20 to 80 % of the edges across."""
        return cls(*rng.uniform([0.03, 10, 0.2], [0.2, 60, 0.8]).tolist())

    def apply(self, smooth: Floats, truth: Floats, edges: Ints, rotations: Floats, rng: np.random.Generator) -> None:
        """Turn the measurements of the edges that agree.

        Parameters
        ----------
        smooth
            (n,) smooth function on the cameras.
        truth, edges, rotations
            (n, 3, 3), (m, 2), and (m, 3, 3): exp(b) R_i R_j^T, which becomes exp(b) R_i F R_j^T in place, where F turns
            about the vertical of the world.
        """
        part = smooth < np.quantile(smooth, self.share)
        i, j = edges.T
        across = np.flatnonzero(part[i] != part[j])
        turned = across[rng.random(len(across)) < self.agreeing]
        signs = np.where(part[i[turned]], 1.0, -1.0)
        fold = so3.exp(np.radians(self.angle_deg) * signs[:, None] * np.array([0.0, 1.0, 0.0]))
        at_j = truth[j[turned]]
        rotations[turned] = rotations[turned] @ at_j @ fold @ np.swapaxes(at_j, -1, -2)
