"""What the errors of a graph's edges are like, in numbers that do not depend on the gauge."""

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Floats, Instance, Ints
from bench.core.triangles import closures, sample_triangles

QUANTILES = (5, 25, 50, 75, 95)
SPREAD = (10, 50, 90)
BANDS_DEG = ((0, 1), (1, 3), (3, 10), (10, 30))
OUTLIER_DEG = 20.0
LEVEL_DEG = 5.0  # an outlier whose roll is wrong by less is level
EDGES_OF_A_CAMERA = 5  # at least, for its errors to have a direction
TRIANGLES = 20_000
AXES = ("tilt", "pan", "roll")  # about x, y and z of the camera

# Groups of quantities; of each group, the names of its values.
ERROR, CLOSURE, COHERENCE = "edge error", "triangle closure", "coherence"
BELOW, BEYOND, OUTLIERS = "axes of good edges", "axes of outliers", "outliers"
DEGREE, ANGLE = "degree", "relative angle"

Fingerprint = dict[tuple[str, str], float]


def fingerprint(instance: Instance) -> Fingerprint:
    """Numbers by group and name, in degrees where they are angles; NaN where a graph does not have them.

    - **edge error**: quantiles of the angle between R_ij and R_i R_j^T at the truth.
    - **triangle closure**: quantiles of the angle of R_ij R_jk R_ik^T over triangles.
    - **coherence**: whether errors at a camera point the same way. Of the edges at a camera whose errors are in a band,
      |mean| / (RMS / sqrt(number)) of the errors' components about x and y in the camera's frame; the median over
      cameras with five such edges or more. Independent errors have 0.8 to 0.9.
    - **axes**: medians of the components of errors about the camera's x, y and z, of edges up to 20 degrees and beyond.
    - **outliers**: the share of edges beyond 20 degrees, and how many of these are level (roll within 5 degrees).
    - **degree**, **relative angle**: quantiles over cameras, and of the true angles over edges.

    Edges without truth take no part but in closures and degrees.

    Raises
    ------
    InputError
        Where no edge has truth at both ends.
    """
    problem, truth, known = instance.problem, instance.truth, known_edges(instance)
    if truth is None or not known.any():
        raise InputError(f"{instance.name}: no edge has ground truth at both ends, so that its error is not known")
    edges, measured = problem.edges[known], problem.rotations[known]
    i, j = edges.T
    relative = truth[i] @ np.swapaxes(truth[j], -1, -2)
    at_i = np.degrees(so3.log(measured @ np.swapaxes(relative, -1, -2)))
    at_j = np.degrees(so3.log(np.swapaxes(measured, -1, -2) @ relative))
    sizes = np.linalg.norm(at_i, axis=1)
    triangles = sample_triangles(problem, TRIANGLES, np.random.default_rng(0))
    closing = np.degrees(closures(problem.rotations, triangles))
    beyond = sizes > OUTLIER_DEG
    level = np.abs(at_i[beyond, 2]) < LEVEL_DEG
    return {
        **_quantiles(ERROR, sizes, QUANTILES),
        **_quantiles(CLOSURE, closing, QUANTILES),
        **{(COHERENCE, f"{low}-{high}"): coherence(edges, at_i, at_j, low, high) for low, high in BANDS_DEG},
        **dict(zip([(BELOW, axis) for axis in AXES], _medians(at_i[~beyond]), strict=True)),
        **dict(zip([(BEYOND, axis) for axis in AXES], _medians(at_i[beyond]), strict=True)),
        (OUTLIERS, "share"): float(beyond.mean()),
        (OUTLIERS, "level"): float(level.mean()) if len(level) else float("nan"),
        **_quantiles(DEGREE, problem.degree, SPREAD),
        **_quantiles(ANGLE, np.degrees(so3.angle(relative)), SPREAD),
    }


def known_edges(instance: Instance) -> NDArray[np.bool_]:
    """(m,) True on edges with ground truth at both ends."""
    if instance.truth is None:
        return np.zeros(instance.problem.m, dtype=bool)
    cameras = np.asarray(np.isfinite(instance.truth).all(axis=(1, 2)))
    return np.asarray(cameras[instance.problem.edges].all(axis=1))


def coherence(edges: Ints, at_i: Floats, at_j: Floats, low_deg: float, high_deg: float) -> float:
    """How much the errors at a camera point the same way; see `fingerprint`. NaN where no camera has edges enough.

    Parameters
    ----------
    edges
        (m, 2).
    at_i, at_j
        (m, 3) rotation vectors of the errors in the frames of either camera, degrees.
    low_deg, high_deg
        Of the errors that are taken.
    """
    ends, vectors = np.concatenate([edges[:, 0], edges[:, 1]]), np.concatenate([at_i, at_j])
    sizes = np.linalg.norm(vectors, axis=1)
    taken = (sizes >= low_deg) & (sizes < high_deg)
    ends, across = ends[taken], vectors[taken, :2]
    count = np.bincount(ends)
    sums = np.stack([np.bincount(ends, across[:, axis]) for axis in (0, 1)])
    squares = np.bincount(ends, (across**2).sum(axis=1))
    enough = (count >= EDGES_OF_A_CAMERA) & (squares > 0)
    if not enough.any():
        return float("nan")
    return float(np.median(np.linalg.norm(sums[:, enough], axis=0) / np.sqrt(squares[enough])))


def _quantiles(group: str, values: NDArray[np.number], levels: tuple[int, ...]) -> Fingerprint:
    found = np.quantile(values, np.array(levels) / 100) if len(values) else np.full(len(levels), np.nan)
    return {(group, f"{level} %"): float(value) for level, value in zip(levels, found, strict=True)}


def _medians(vectors: Floats) -> list[float]:
    if not len(vectors):
        return [float("nan")] * len(AXES)
    return [float(value) for value in np.median(np.abs(vectors), axis=0)]
