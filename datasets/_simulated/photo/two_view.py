"""The relative rotation of two pictures, as COLMAP estimates it from matches."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import Floats, Ints

from .matches import Matches

if TYPE_CHECKING:
    from .cameras import Cameras

_TRIALS = 1000  # of RANSAC at most, as many as structure from motion of its time did; COLMAP's default is 10 000


@dataclass(frozen=True, eq=False)
class TwoViews:
    """What is estimated of two pictures i and j.

    Parameters
    ----------
    rotation, direction
        R_ij (3, 3), and t (3,) in x_j ~ R_ij^T x_i + t.
    inliers
        (k,) which matches agree with it.
    """

    rotation: Floats
    direction: Floats
    inliers: Ints


def estimate(matches: Matches, cameras: "Cameras", i: int, j: int, least: int, seed: int) -> TwoViews | None:
    """Calibrated two-view geometry with the guessed focal lengths; None where fewer than `least` matches agree.

    COLMAP's own choice between an essential matrix and a homography, and its thresholds, at their defaults (4
    pixels), but for the number of trials. The same seed gives the same bits, in whichever thread.
    """
    import pycolmap

    options = pycolmap.TwoViewGeometryOptions()
    options.min_num_inliers = least
    options.compute_relative_pose = True
    options.ransac.random_seed = seed
    options.ransac.max_num_trials = _TRIALS
    order = np.repeat(np.arange(len(matches.first), dtype=np.uint32)[:, None], 2, axis=1)
    one, two = _camera(pycolmap, cameras, i), _camera(pycolmap, cameras, j)
    found = pycolmap.estimate_calibrated_two_view_geometry(one, matches.first, two, matches.second, order, options)
    if found.cam2_from_cam1 is None or len(found.inlier_matches) < least:
        return None
    rotation = np.ascontiguousarray(found.cam2_from_cam1.rotation.matrix().T)
    return TwoViews(rotation, found.cam2_from_cam1.translation, found.inlier_matches[:, 0].astype(np.int64))


def _camera(pycolmap: Any, cameras: "Cameras", k: int) -> Any:
    width, height = cameras.sizes[k]
    parameters = [cameras.guesses[k], width / 2, height / 2]
    return pycolmap.Camera(model="SIMPLE_PINHOLE", width=int(width), height=int(height), params=parameters)
