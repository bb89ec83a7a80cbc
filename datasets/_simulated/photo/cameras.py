"""Cameras that look at a place: what is true of them, and what is thought of their focal lengths."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, so3

from .layouts import Place

WIDTH, HEIGHT = 1600.0, 1200.0  # pixels, of a picture that is wider than tall
_EXIF_ERROR = 0.015  # of the logarithm of a focal length that a camera wrote down
_UPRIGHT = 0.25  # share of the pictures that are taller than wide
_ROLL = np.radians(2)  # standard deviation
_YIELD, _YIELD_SPREAD = 0.5, 0.6  # median, and standard deviation of the logarithm


@dataclass(frozen=True, eq=False)
class Cameras:
    """n cameras.

    Parameters
    ----------
    rotations
        (n, 3, 3) world to camera; x right, y down, z forward.
    centres
        (n, 3) metres.
    focals
        (n,) pixels.
    guesses
        (n,) pixels: what two-view estimation takes for the focal lengths.
    distortions
        (n,) k of r -> r (1 + k r^2), where r is the distance from the centre over the focal length; two-view
        estimation takes it for zero.
    sizes
        (n, 2) width and height of the picture, pixels.
    yields
        (n,) share of the features in view that are found.
    conditions
        (n,) light, season and weather as one number; the further apart, the less is matched.
    """

    rotations: Floats
    centres: Floats
    focals: Floats
    guesses: Floats
    distortions: Floats
    sizes: Floats
    yields: Floats
    conditions: Floats


def stand(place: Place, focal_error: float, exif: float, distortion: float, rng: np.random.Generator) -> Cameras:
    """The cameras of a place.

    Parameters
    ----------
    place
        Where they are and what they look at.
    focal_error
        Standard deviation of the logarithm of a guessed focal length.
    exif
        Share of the cameras whose focal length is known, to 1.5 %.
    distortion
        Standard deviation of k; its mean is minus half of that, for most lenses bend lines outwards.
    """
    n = len(place.centres)
    narrow, wide = (0.5 * WIDTH / np.tan(np.radians(field) / 2) for field in place.fields_deg)
    focals = np.exp(rng.uniform(np.log(wide), np.log(narrow), n))
    error = np.where(rng.random(n) < exif, _EXIF_ERROR, focal_error) * rng.standard_normal(n)
    upright = rng.random((n, 1)) < _UPRIGHT
    return Cameras(
        rotations=looking(place.centres, place.targets, _ROLL * rng.standard_normal(n)),
        centres=place.centres,
        focals=focals,
        guesses=focals * np.exp(error),
        distortions=distortion * (rng.standard_normal(n) - 0.5),
        sizes=np.where(upright, [HEIGHT, WIDTH], [WIDTH, HEIGHT]),
        yields=np.clip(_YIELD * np.exp(_YIELD_SPREAD * rng.standard_normal(n)), 0.05, 0.95),
        conditions=rng.standard_normal(n),
    )


def looking(centres: Floats, targets: Floats, roll: Floats) -> Floats:
    """Rotations (n, 3, 3) of cameras at `centres` that look at `targets` (n, 3), turned by `roll` (n,) about that axis.

    None may look straight up or down.
    """
    forward = _unit(targets - centres)
    right = _unit(np.cross(forward, [0.0, 0.0, 1.0]))
    level = np.stack([right, np.cross(forward, right), forward], axis=1)
    return so3.exp(roll[:, None] * np.array([0.0, 0.0, 1.0])) @ level


def _unit(vectors: Floats) -> Floats:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
