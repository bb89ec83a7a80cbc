"""Photo collections simulated with their physics: relative rotations that COLMAP estimates from simulated pictures."""

import importlib.metadata
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Instance, Missing, Problem, Source, dataset, parameter, so3, stream

from ._files.folders import cache, revision
from ._files.kept import keep, kept
from ._files.progress import counting_bar
from ._simulated.photo import CODE
from ._simulated.photo.collection import Collection, Physics, collect
from ._simulated.photo.layouts import Layout
from ._simulated.statistics import statistics

FOLDER = "photo-collections"
_ESTIMATOR = "pycolmap"
_ARRAYS = tuple(field.name for field in fields(Collection))
_DOWN = np.array([0.0, 0.0, -1.0])


@dataset("photo-collection", title="Simulated photo collections", cite="schonberger2016")
@dataclass(frozen=True)
class PhotoCollection:
    """Pictures of a place of known geometry, with the relative rotations that COLMAP estimates from their matches.

    Nothing is drawn from a law of errors: they follow from what makes them in photographs. A camera i at c_i with
    rotation R_i, focal length f_i and distortion k_i shows a feature X of the place at

        u = f_i p (1 + k_i |p|^2) + centre + noise,    p = (x, y) / z,    (x, y, z) = R_i (X - c_i)

    where it is in the picture, not hidden by a wall, at most 78 degrees from the normal of its surface, and from 1.6 to
    60 pixels large. Features have the sizes of scale space (density s^-3), so that two pictures of different scale have
    few in common; a camera finds a random share of them, and none behind a random upright strip of the picture. Of
    features found in both pictures a share 0.9 exp(-(a / 45 degrees)^2 - 0.15 c^2) match, where a is the angle
    between the lines of sight and c the difference of two standard normal numbers, the conditions; in a share
    `one_sided` of the pairs only those around a spot that each picture has. Wrong matches are added, log-normal in
    number (sigma 1). Pairs with 20 features in common are handed to COLMAP's calibrated two-view geometry, with the
    guessed focal lengths and without distortion; those with `inliers` matches that agree become edges, and the
    largest component of them is the problem.

    A `repeated` place has surfaces that bear features of others. A feature seen twice in one picture matches nothing,
    but a picture of one surface matches a picture of its repetition, and all such pairs are wrong by the same rotation
    of the world: a fold.

    Edges come with inlier counts as weights, with precisions from the Jacobian of the Sampson errors (for ranking:
    they know nothing of wrong focal lengths, and their sigmas are about three times too small), and with gravity.
    Axes of cameras are COLMAP's: x right, y down, z forward. Outliers are edges over 20 degrees off, the bound of
    Purkait et al. (2020); `Instance.coherent` tells those most of whose inliers are matches with a repetition.

    What differs from photographs: features are points on rectangles with a clustered relief, not texture; there is no
    image, hence no descriptor, and repetitions are exact; the principal point is in the centre, and nobody cropped;
    RANSAC stops after 1000 trials, where COLMAP's default is 10 000; at most 400 right matches are kept of a pair.
    The spreads of the angles of match, of conditions, wrong matches and one-sided pairs were set on two scenes,
    Madrid Metropolis and Union Square of ``1dsfm``, so that the errors of the edges and of triangles of the facade
    resemble theirs; no other scene was looked at.

    It needs pycolmap once: what it made is kept among the downloads, one file for each set of parameters, seed, version
    of this code and of pycolmap. The same machine makes the same bits, whatever the number of cores.

    Parameters
    ----------
    layout
        ``facade`` (a corner building from the street), ``square`` (fronts all round), ``street`` (a video with a
        loop), ``rooms`` (indoors, joined by doors), ``orbit`` (an object from all sides) or ``aerial`` (a flight).
    n
        Cameras; those outside the largest component are left out.
    focal_error
        Standard deviation of the logarithm of a focal length that is guessed.
    exif
        Share of the cameras whose focal length is known, to 1.5 %.
    distortion
        Standard deviation of k; its mean is minus half of that.
    noise_px
        Standard deviation of the place of a small feature, pixels of 1600 across; larger ones are less certain.
    features
        In view of a typical camera; about half of them are found.
    mismatches
        Mean number of wrong matches of a pair.
    one_sided
        Share of the pairs that match in one part of the picture only.
    repeated
        Share of the features of some surfaces that repeat those of another one.
    inliers
        Fewest matches that make an edge.
    gravity_deg
        Standard deviation of the direction of gravity about each axis of the camera, degrees.
    """

    layout: Layout = "facade"
    n: int = parameter(200, at_least=2, at_most=1000)
    focal_error: float = parameter(0.3, at_least=0, at_most=1)
    exif: float = parameter(0.7, at_least=0, at_most=1)
    distortion: float = parameter(0.08, at_least=0, at_most=0.3)
    noise_px: float = parameter(0.8, at_least=0, at_most=10)
    features: int = parameter(4000, at_least=50, at_most=20_000)
    mismatches: float = parameter(20.0, at_least=0, at_most=500)
    one_sided: float = parameter(0.8, at_least=0, at_most=1)
    repeated: float = parameter(0.06, at_least=0, at_most=1)
    inliers: int = parameter(15, at_least=8, at_most=1000)
    gravity_deg: float = parameter(1.0, at_least=0, at_most=90)

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source | Missing]:
        """One instance for each seed; `Missing` where it is not kept and pycolmap is not installed."""
        identity = revision([Path(__file__), *CODE], repr(self), str(seed))
        version = _installed() or _made_with(identity)
        if version is None:
            yield Missing(self._name(), f"python -m pip install {_ESTIMATOR}")
            return
        of_version = revision((), identity, version)
        path = _file(identity, version)
        yield Source(self._name(), of_version, lambda: self._load(seed, path, version, of_version), seeded=True)

    def _load(self, seed: int, path: Path, version: str, identity: str) -> Instance:
        arrays = kept(path, _ARRAYS)
        if arrays is None:
            with counting_bar("pairs of pictures") as update:
                made = collect(Physics.of(self), seed, update)
            arrays = {name: getattr(made, name) for name in _ARRAYS}
            keep(path, arrays)
        return self._instance(arrays, seed, version, identity)

    def _instance(self, arrays: dict[str, NDArray[Any]], seed: int, version: str, identity: str) -> Instance:
        truth: Floats = arrays["truth"]
        rng = stream(seed, "data", "photo-collection", "gravity")
        shaken = so3.exp(np.radians(self.gravity_deg) * rng.standard_normal((len(truth), 3)))
        problem = Problem(
            len(truth),
            arrays["edges"],
            arrays["rotations"],
            weights=arrays["counts"],
            weights_kind="count",
            precisions=arrays["precisions"],
            gravity=shaken @ truth @ _DOWN,
        )
        return Instance(
            problem,
            truth,
            name=self._name(),
            outliers=arrays["outliers"],
            coherent=arrays["coherent"],
            source=f"simulated pictures of a place ({self.layout}); two-view geometry of pycolmap {version}",
            revision=identity,
            notes=(f"{len(truth)} of {self.n} pictures are in the largest component",),
            statistics=statistics(problem),
        )

    def _name(self) -> str:
        """``facade-n200``, then every other parameter that is not at its default."""
        own = [f"{f.name}{getattr(self, f.name)}" for f in fields(self)[2:] if getattr(self, f.name) != f.default]
        return "-".join([self.layout, f"n{self.n}", *own])


def _installed() -> str | None:
    """Version of the estimator, found without importing it."""
    try:
        return importlib.metadata.version(_ESTIMATOR)
    except importlib.metadata.PackageNotFoundError:
        return None


def _made_with(identity: str) -> str | None:
    """Version with which a collection was made that is kept here; the last in the alphabet of several."""
    found = [path.name for path in _file(identity, "").parent.glob(f"{identity}-*.npz")]
    return max(found).removeprefix(f"{identity}-").removesuffix(".npz") if found else None


def _file(identity: str, version: str) -> Path:
    return cache() / FOLDER / f"{identity}-{version}.npz"
