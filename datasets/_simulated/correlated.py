"""Errors as they are in collections of photographs: correlated at cameras, wrong in pan and tilt, seldom in roll.

The independent models of `noise` give each edge an error of its own. On real scenes the errors at one camera point the
same way (a wrong focal length, distortion, matches on one side), so that averaging many edges does not remove them, and
a camera that is bad has many bad edges. The shape of this law and its ranges were set on Madrid Metropolis, whose truth
is known for a part, and on Union Square, measured against an estimate; other scenes served as checks (see
results/reference/calibration).
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints, so3

from . import draws, folds, upright
from . import overlap as overlaps
from . import sizes as size_laws
from .draws import Draw, chunks, relative, units
from .folds import Fold
from .overlap import overlap
from .sizes import OUTLIER_DEG, Sizes
from .upright import Upright, smooth_function

_MODULES = (draws, folds, overlaps, size_laws, upright)
CODE = tuple(Path(str(file)) for file in (__file__, *(m.__file__ for m in _MODULES)))  # decides what is simulated
INFORMED = (
    "the law of the errors was set on Madrid Metropolis and Union Square of 1DSfM; Ellis Island, NYC Library and "
    "Piazza del Popolo were looked at as checks"
)
_NEAR = np.radians(2.0)  # added to an angle before its logarithm is taken
_RISE = 0.25  # of the logarithm of the coherence with the latent quality
_FOLDED = 0.5  # share of the graphs
_ONE_SIDED = 0.5  # standard deviation of the logarithm of how one-sided cameras are

# From which the parameters of a graph are drawn: about twice as wide as what Madrid Metropolis and Union Square show.
_RANGES = {
    "camera": (0.2, 0.45),
    "angle": (0.04, 0.22),
    "overlap": (0.02, 0.15),
    "likeness": (0.03, 0.17),
    "coherence": (0.15, 0.6),
    "tilt": (0.3, 0.9),
    "roll": (0.1, 0.3),
    "isotropic": (0.0, 0.3),
    "to_identity": (0.0, 0.15),
    "warp_deg": (0.2, 0.9),
    "noise_deg": (0.15, 0.6),
}


@dataclass(frozen=True)
class Law:
    """The law of correlated errors, of one graph.

    Edge (i, j) measures exp(b + c) S_i S_j^T, in the frame of camera i (x right, y up, z along the optical axis). The
    small c is normal, with standard deviation `noise_deg` times axes = (tilt, 1, roll), and independent of all else.

    S_i = R_i exp(w_i) is the camera as the edges agree that it is. The **warp** w_i, of median length `warp_deg`, is a
    linear function of three numbers of the camera (f_i below, and a smooth function on the graph), so that cameras
    whose edges are good are turned alike: triangles do not see it, and no method can undo it.

    The **size** of b grows with a latent quality z of variance 1, a sum of independent parts whose variances add up:
    `camera`: (q_i + q_j) / sqrt 2 with q the cameras' (exponential); `angle`: the logarithm of the true angle;
    `overlap`: less where the neighbourhoods of i and j have more in common; `likeness`: less where f_i . f_j is larger,
    with f, two normal numbers for each camera, what a photograph looks like, so that cameras fall into groups that
    match well among themselves; the rest is the edge's own. `sizes` says which z has which size.

    Its **direction** is that of axes * e_ij + coherence exp(z / 4) (g_i d_i - R_i R_j^T g_j d_j): e is the edge's own,
    d is a unit vector of each camera, weighted by axes, and g (log-normal, 0.5) says how one-sided the camera is. Of
    the outliers, the share `isotropic` has any axis instead, and `to_identity` errs along the geodesic to the identity.

    Parameters
    ----------
    sizes
        Distribution of the sizes.
    camera, angle, overlap, likeness
        Shares of the variance of the latent quality.
    coherence
        How much of an error's direction is the camera's.
    tilt, roll
        Size of the errors about the camera's x and z axes, relative to those about y (the pan).
    isotropic, to_identity
        Shares of the outliers.
    warp_deg, noise_deg
        See above.
    cameras
        How the cameras are turned.
    fold
        A part of the scene that hangs on to the rest by edges that are wrong all in the same way; None for none.
    """

    sizes: Sizes = field(default_factory=Sizes)
    camera: float = 0.35
    angle: float = 0.14
    overlap: float = 0.1
    likeness: float = 0.13
    coherence: float = 0.33
    tilt: float = 0.6
    roll: float = 0.15
    isotropic: float = 0.1
    to_identity: float = 0.05
    warp_deg: float = 0.4
    noise_deg: float = 0.3
    cameras: Upright = field(default_factory=Upright)
    fold: Fold | None = None

    @classmethod
    def drawn(cls, rng: np.random.Generator, median_deg: float | None = None, outliers: float | None = None) -> "Law":
        """A law with every parameter from its range, but for what is given, and with a fold in half of the draws."""
        values = {name: float(rng.uniform(*ends)) for name, ends in _RANGES.items()}
        sizes = Sizes.drawn(rng)
        given = {"median_deg": median_deg, "outliers": outliers}
        sizes = replace(sizes, **{name: value for name, value in given.items() if value is not None})
        cameras, fold = Upright.drawn(rng), Fold.drawn(rng)
        return cls(sizes, **values, cameras=cameras, fold=fold if rng.random() < _FOLDED else None)

    @classmethod
    def independent(cls, sizes: Sizes, cameras: Upright) -> "Law":
        """The contrast: nothing that edges share, and errors about the same axes."""
        return cls(sizes, 0, 0, 0, 0, coherence=0, warp_deg=0, cameras=cameras)

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
        draw = self.draw(n, edges, rng)
        rotations = np.empty((len(edges), 3, 3))
        outliers = np.empty(len(edges), dtype=bool)
        sizes = self.sizes.of(draw.quality)
        for part in chunks(len(edges)):
            rotations[part] = draw.measured(sizes, part)
        if self.fold is not None:
            self.fold.apply(draw.smooth, draw.truth, edges, rotations, rng)
        for part in chunks(len(edges)):
            wrong = so3.angle_between(rotations[part], relative(draw.truth, edges[part]))
            outliers[part] = wrong > np.radians(OUTLIER_DEG)
        return draw.truth, rotations, outliers

    def draw(self, n: int, edges: Ints, rng: np.random.Generator) -> Draw:
        """Everything that is random but the fold."""
        smooth = smooth_function(n, edges, rng)
        truth = self.cameras.rotations(smooth, rng)
        looks = rng.standard_normal((n, 2))
        warp = np.column_stack([looks, smooth]) @ rng.standard_normal((3, 3)) * np.array([self.tilt, 1, self.tilt])
        warp *= np.radians(self.warp_deg) / np.median(np.linalg.norm(warp, axis=1))
        seen = truth @ so3.exp(warp)
        quality = self._quality(seen, looks, edges, rng)
        directions, outlying = self._directions(seen, quality, edges, rng)
        noise = np.radians(self.noise_deg) * self._axes * rng.standard_normal((len(edges), 3))
        return Draw(smooth, truth, seen, edges, quality, directions, outlying, noise)

    @property
    def _axes(self) -> Floats:
        return np.array([self.tilt, 1.0, self.roll])

    def _quality(self, cameras: Floats, looks: Floats, edges: Ints, rng: np.random.Generator) -> Floats:
        """Latent quality (m,); the larger, the worse."""
        n, m = len(cameras), len(edges)
        i, j = edges.T
        own = rng.standard_exponential(n)
        angles = np.concatenate([so3.angle(relative(cameras, edges[part])) for part in chunks(m)])
        rest = 1 - self.camera - self.angle - self.overlap - self.likeness
        return np.asarray(
            np.sqrt(self.camera) * _standard(own[i] + own[j])
            + np.sqrt(self.angle) * _standard(np.log(angles + _NEAR))
            - np.sqrt(self.overlap) * _standard(overlap(n, edges, rng))
            - np.sqrt(self.likeness) * _standard(np.einsum("ek,ek->e", looks[i], looks[j]))
            + np.sqrt(rest) * rng.standard_normal(m)
        )

    def _directions(
        self, cameras: Floats, quality: Floats, edges: Ints, rng: np.random.Generator
    ) -> tuple[Floats, Floats]:
        """Unit vectors (m, 3) about which edges are wrong, and those of the same edges were they outliers."""
        n, m = len(cameras), len(edges)
        one_sided = np.exp(_ONE_SIDED * rng.standard_normal((n, 1))) * units(self._axes * rng.standard_normal((n, 3)))
        directions, outlying = np.empty((m, 3)), np.empty((m, 3))
        for part in chunks(m):
            i, j = edges[part].T
            turn = relative(cameras, edges[part])
            own = rng.standard_normal((len(i), 3))
            shared = one_sided[i] - np.einsum("eab,eb->ea", turn, one_sided[j])
            directions[part] = units(self._axes * own + self.coherence * np.exp(_RISE * quality[part, None]) * shared)
            kind = rng.random((len(i), 1))
            back = -units(so3.log(turn))
            special = np.where(kind < self.isotropic, units(own), back)
            outlying[part] = np.where(kind < self.isotropic + self.to_identity, special, directions[part])
        return directions, outlying


def _standard(values: Floats) -> Floats:
    """The values with mean 0 and variance 1, or 0 where all are equal."""
    return (values - values.mean()) / (values.std() or 1.0)
