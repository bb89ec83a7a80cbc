"""Errors as they are in collections of photographs: correlated at cameras, wrong in pan and tilt, seldom in roll.

The independent models of `noise` give each edge an error of its own. On real scenes the errors at one camera point the
same way (a wrong focal length, distortion, matches on one side), so that averaging many edges does not remove them, and
a camera that is bad has many bad edges. The shape of this law and its ranges were set on Madrid Metropolis, whose truth
is known for a part, and on Union Square, measured against an estimate; on no other scene.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints, so3

from . import folds, upright
from .folds import Fold
from .upright import Upright, smooth_function

CODE = tuple(Path(str(file)) for file in (__file__, folds.__file__, upright.__file__))  # decides what is simulated

OUTLIER_DEG = 20.0  # an edge that is wrong by more counts as an outlier
_CHUNK = 1 << 19  # edges measured at a time, so that memory beyond the result stays bounded
_NEAR = np.radians(2.0)  # added to an angle before its logarithm is taken


@dataclass(frozen=True)
class Law:
    """The law of correlated errors, of one graph.

    Edge (i, j) measures exp(b) R_i R_j^T, with b in the frame of camera i (x right, y up, z along the optical axis).

    The **size** of b grows with a latent quality z: sqrt(camera / 2) (q_i + q_j) + sqrt(angle) a_ij + sqrt(rest) e_ij,
    where q are the cameras' (exponential, centred), a is the standardised logarithm of the true angle, e is the
    edge's own, and camera + angle + rest = 1. Below the median the size is log-normal with standard deviation
    `spread`; above it with the one that makes the share beyond 20 degrees exactly `outliers`. What exceeds half a turn
    wraps around.

    Its **direction** is that of axes * (w_ij + coherence (g_i d_i - R_i R_j^T g_j d_j)): w is the edge's own, d is a
    unit vector of each camera, and g (log-normal, 0.5) says how one-sided the camera is. Of the outliers, the share
    `isotropic` has any axis instead, and `to_identity` errs along the geodesic to the identity.

    Parameters
    ----------
    median_deg, outliers, spread
        Of the sizes: see above. `outliers` is below a half, and leaves out the edges of a fold.
    camera, angle
        Shares of the variance of the latent quality.
    coherence
        How much of an error's direction is the camera's.
    tilt, roll
        Size of the errors about the camera's x and z axes, relative to those about y (the pan).
    isotropic, to_identity
        Shares of the outliers.
    cameras
        How the cameras are turned.
    fold
        A part of the scene that hangs on to the rest by edges that are wrong all in the same way; None for none.
    """

    median_deg: float = 4.0
    outliers: float = 0.15
    spread: float = 1.4
    camera: float = 0.35
    angle: float = 0.12
    coherence: float = 0.5
    tilt: float = 0.6
    roll: float = 0.15
    isotropic: float = 0.1
    to_identity: float = 0.05
    cameras: Upright = field(default_factory=Upright)
    fold: Fold | None = None

    @classmethod
    def drawn(cls, rng: np.random.Generator, median_deg: float | None = None, outliers: float | None = None) -> "Law":
        """A law with every parameter from a range about twice as wide as what two real scenes show.

        Parameters
        ----------
        median_deg, outliers
            Instead of those drawn.
        """
        ranges = {
            "median_deg": (1.5, 8.0),
            "outliers": (0.04, 0.35),
            "spread": (1.1, 1.7),
            "camera": (0.2, 0.5),
            "angle": (0.03, 0.25),
            "coherence": (0.2, 0.8),
            "tilt": (0.3, 0.9),
            "roll": (0.1, 0.3),
            "isotropic": (0.0, 0.3),
            "to_identity": (0.0, 0.15),
        }
        values = {
            name: float(np.exp(rng.uniform(*np.log(ends)))) if name == "median_deg" else float(rng.uniform(*ends))
            for name, ends in ranges.items()
        }
        given = {"median_deg": median_deg, "outliers": outliers}
        values |= {name: value for name, value in given.items() if value is not None}
        return cls(**values, cameras=Upright.drawn(rng), fold=Fold.drawn(rng))

    def simulate(self, n: int, edges: Ints, rng: np.random.Generator) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Cameras and measurements on a graph, at a cost linear in its edges.

        Parameters
        ----------
        edges
            (m, 2).

        Returns
        -------
        tuple
            Truth (n, 3, 3), measured rotations (m, 3, 3), and the mask (m,) of the edges that are wrong by more than
            20 degrees.
        """
        smooth = smooth_function(n, edges, rng)
        truth = self.cameras.rotations(smooth, rng)
        rotations = self.measure(truth, edges, rng)
        if self.fold is not None:
            self.fold.apply(smooth, truth, edges, rotations, rng)
        outliers = np.empty(len(edges), dtype=bool)
        for part in _parts(len(edges)):
            wrong = so3.angle_between(rotations[part], _relative(truth, edges[part]))
            outliers[part] = wrong > np.radians(OUTLIER_DEG)
        return truth, rotations, outliers

    def measure(self, truth: Floats, edges: Ints, rng: np.random.Generator) -> Floats:
        """Measured rotations (m, 3, 3) on `edges` (m, 2) of cameras (n, 3, 3), without the fold."""
        n, m = len(truth), len(edges)
        sizes = self._sizes(truth, edges, rng)
        one_sided = _units(self._axes * rng.standard_normal((n, 3))) * np.exp(0.5 * rng.standard_normal((n, 1)))
        kinds = np.where(sizes > np.radians(OUTLIER_DEG), rng.random(m), 1.0)
        rotations = np.empty((m, 3, 3))
        for part in _parts(m):
            relative = _relative(truth, edges[part])
            directions = self._directions(one_sided, edges[part], relative, kinds[part], rng)
            rotations[part] = so3.exp(sizes[part, None] * directions) @ relative
        return rotations

    @property
    def _axes(self) -> Floats:
        return np.array([self.tilt, 1.0, self.roll])

    def _sizes(self, truth: Floats, edges: Ints, rng: np.random.Generator) -> Floats:
        """Angles (m,) by which the measurements are wrong, radians, not yet wrapped."""
        i, j = edges.T
        quality = rng.standard_exponential(len(truth)) - 1
        angles = np.concatenate([so3.angle(_relative(truth, edges[part])) for part in _parts(len(edges))])
        wide = np.log(angles + _NEAR)
        wide = (wide - wide.mean()) / (wide.std() or 1.0)
        rest = np.sqrt(1 - self.camera - self.angle) * rng.standard_normal(len(edges))
        z = np.sqrt(self.camera / 2) * (quality[i] + quality[j]) + np.sqrt(self.angle) * wide + rest
        z -= np.median(z)
        beyond = np.quantile(z, 1 - self.outliers)
        above = np.log(OUTLIER_DEG / self.median_deg) / beyond if beyond > 0 else 0.0
        return np.asarray(np.radians(self.median_deg) * np.exp(np.where(z < 0, self.spread, above) * z))

    def _directions(
        self, one_sided: Floats, edges: Ints, relative: Floats, kinds: Floats, rng: np.random.Generator
    ) -> Floats:
        """Unit vectors (k, 3) about which the measurements of k edges are wrong.

        Parameters
        ----------
        one_sided
            (n, 3) g d of every camera.
        kinds
            (k,) uniform on [0, 1) on outliers, which it tells apart; 1 elsewhere.
        """
        i, j = edges.T
        own = rng.standard_normal((len(edges), 3))
        shared = one_sided[i] - np.einsum("kab,kb->ka", relative, one_sided[j])
        directions = _units(self._axes * own + self.coherence * shared)
        isotropic = kinds < self.isotropic
        directions[isotropic] = _units(own[isotropic])
        back = (kinds >= self.isotropic) & (kinds < self.isotropic + self.to_identity)
        directions[back] = -_units(so3.log(relative[back]))
        return directions


def check_given(median_deg: float | None, outliers: float | None) -> None:
    """Refuse a median error and a share of outliers that no law has; `ValueError`."""
    if median_deg is not None and not 0 < median_deg < OUTLIER_DEG:
        raise ValueError(
            f"'noise_deg' must be above 0 and below {OUTLIER_DEG:g} for noise=correlated, not {median_deg}"
        )
    if outliers is not None and not outliers < 0.5:
        raise ValueError(f"'outliers' must be below 0.5 for noise=correlated, not {outliers}")


def _relative(rotations: Floats, edges: Ints) -> Floats:
    i, j = edges.T
    return rotations[i] @ np.swapaxes(rotations[j], -1, -2)


def _units(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0, lengths, 1.0)


def _parts(m: int) -> list[slice]:
    return [slice(start, start + _CHUNK) for start in range(0, m, _CHUNK)]
