"""What a camera finds of the features of a place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints

from .cameras import Cameras
from .points import Points
from .surfaces import Surface, hidden

_STEEPEST = np.cos(np.radians(78))  # of a line of sight to a surface that still shows its features
RESOLVED_PX = 1.6  # size of the least feature that is found: the first scale of SIFT
_LARGEST_PX = 60.0
_WIDEST = 1.2  # of the distance from the centre of the picture, over the focal length
_BLUR_PX = 8.0  # size of a feature whose place is sqrt(2) times as uncertain as that of the least


@dataclass(frozen=True, eq=False)
class View:
    """Features found in one picture, without those that look like another one in the same picture.

    Parameters
    ----------
    looks
        (k,) ascending.
    ids
        (k,) of the points.
    pixels
        (k, 2) from the corner of the picture, with distortion and noise.
    rays
        (k, 3) unit vectors from the point to the camera, in the axes of the world.
    spot
        (2,) the place of the picture, in pixels, around which it matches where it does not match all over.
    """

    looks: Ints
    ids: Ints
    pixels: Floats
    rays: Floats
    spot: Floats


def in_view(camera: int, cameras: Cameras, points: Points, surfaces: list[Surface]) -> tuple[Ints, Floats, Floats]:
    """Ids (k,) of the points that a camera could find, their pixels (k, 2), and their sizes (k,) in pixels."""
    sight = points.positions - cameras.centres[camera]
    x = sight @ cameras.rotations[camera].T
    distance = np.linalg.norm(sight, axis=1)
    focal, size = cameras.focals[camera], cameras.sizes[camera]
    facing = -np.einsum("ij,ij->i", sight, points.normals)
    imaged = focal * points.sizes / distance
    ids = np.flatnonzero(
        (x[:, 2] > 0) & (facing > _STEEPEST * distance) & (imaged > RESOLVED_PX) & (imaged < _LARGEST_PX)
    )
    plane = x[ids, :2] / x[ids, 2:]
    radius2 = np.sum(plane**2, axis=1, keepdims=True)
    pixels = focal * plane * (1 + cameras.distortions[camera] * radius2) + size / 2
    inside = np.all((pixels > 0) & (pixels < size), axis=1) & (radius2[:, 0] < _WIDEST**2)
    ids, pixels = ids[inside], pixels[inside]
    shown = ~hidden(cameras.centres[camera], points.positions[ids], surfaces)
    return ids[shown], pixels[shown], imaged[ids[shown]]


def photograph(
    camera: int, cameras: Cameras, points: Points, surfaces: list[Surface], noise_px: float, rng: np.random.Generator
) -> View:
    """What one camera finds: a share of what is in view, at places that are uncertain by `noise_px` and more."""
    ids, pixels, imaged = in_view(camera, cameras, points, surfaces)
    found = rng.random(len(ids)) < cameras.yields[camera]
    found &= ~_covered(pixels, cameras.sizes[camera], rng)
    looks, first, count = np.unique(points.looks[ids[found]], return_index=True, return_counts=True)
    kept = np.flatnonzero(found)[first[count == 1]]
    ids, imaged = ids[kept], imaged[kept]
    noise = noise_px * np.sqrt(1 + (imaged[:, None] / _BLUR_PX) ** 2) * rng.standard_normal((len(ids), 2))
    rays = cameras.centres[camera] - points.positions[ids]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return View(looks[count == 1], ids, pixels[kept] + noise, rays, cameras.sizes[camera] * rng.random(2))


def _covered(pixels: Floats, size: Floats, rng: np.random.Generator) -> NDArray[np.bool_]:
    """(k,) what people, trees and darkness cover: an upright part of the picture, of random width."""
    width = rng.beta(1.0, 3.0) * size[0]
    left = rng.uniform(-width, size[0])
    return (pixels[:, 0] > left) & (pixels[:, 0] < left + width)
