"""Whether arrays make a problem; what is wrong with the first of them that does not."""

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.errors import InputError

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

ROTATION_TOLERANCE = 1e-6
MOST_CAMERAS = 10_000_000  # so that a damaged number does not take all memory
_LARGEST = 1e6  # the entries of a rotation are at most 1; larger ones still may not overflow a determinant
_SYMMETRIC = 1e-6  # relative


def checked_edges(n: int, edges: Any) -> Ints:
    """Edges (m, 2), i < j, contiguous; a pair may be there several times."""
    if n < 1:
        raise InputError("the graph has no cameras")
    if n > MOST_CAMERAS:
        raise InputError(f"the graph claims {n} cameras, and at most {MOST_CAMERAS} can be handled")
    given = np.asarray(edges)
    if given.ndim != 2 or given.shape[1] != 2:
        raise InputError(f"edges must have shape (m, 2), not {given.shape}")
    if len(given) == 0:
        raise InputError("the graph has no edges")
    if given.dtype.kind not in "iu":
        raise InputError(f"edges must be whole numbers, not {given.dtype}")
    if (bad := (given < 0) | (given >= n)).any():
        row = int(np.flatnonzero(bad.any(axis=1))[0])
        raise InputError(f"edge {row} is {_pair(given[row])}, but camera ids go from 0 to {n - 1}")
    out = np.array(given, dtype=np.int32, order="C")
    if (bad := out[:, 0] == out[:, 1]).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(f"edge {row} is {_pair(out[row])}: a camera with itself")
    if (bad := out[:, 0] > out[:, 1]).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(f"edge {row} is {_pair(out[row])}: edges must have i < j")
    return out


def checked_rotations(edges: Ints, rotations: Any) -> Floats:
    """Relative rotations (m, 3, 3), projected where they are further than the tolerance from SO(3)."""
    given = np.asarray(rotations)
    if given.dtype.kind not in "iuf":
        raise InputError(f"rotations must be numbers, not {given.dtype}")
    if given.shape != (len(edges), 3, 3):
        raise InputError(f"rotations must have shape ({len(edges)}, 3, 3), not {given.shape}")
    out = np.array(given, dtype=np.float64, order="C")
    if (bad := ~np.isfinite(out).all(axis=(1, 2))).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(f"the rotation of edge {row} {_pair(edges[row])} is not finite")
    if (bad := (abs(out) > _LARGEST).any(axis=(1, 2))).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(
            f"the rotation of edge {row} {_pair(edges[row])} has an entry of size {abs(out[row]).max():.3g}"
        )
    if (bad := np.linalg.det(out) <= 0).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(
            f"the rotation of edge {row} {_pair(edges[row])} has determinant {np.linalg.det(out[row]):.3g}, "
            "but a rotation has +1"
        )
    off = np.linalg.norm(out @ np.swapaxes(out, -1, -2) - np.eye(3), axis=(1, 2)) > ROTATION_TOLERANCE
    if off.any():
        warnings.warn(
            f"{off.sum()} of {len(out)} relative rotations were not in SO(3) to {ROTATION_TOLERANCE:g} "
            "and were replaced by the nearest rotation",
            stacklevel=4,
        )
        out[off] = so3.project(out[off])
    return out


def checked_weights(edges: Ints, weights: Any) -> Floats:
    """Weights (m,), positive."""
    out = _floats(weights, "weights", (len(edges),))
    if (bad := ~(np.isfinite(out) & (out > 0))).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(f"the weight of edge {row} {_pair(edges[row])} is {out[row]:g}, not a positive number")
    return out


def checked_precisions(edges: Ints, precisions: Any) -> Floats:
    """Precisions (m, 3, 3), symmetric and positive semidefinite, none zero."""
    out = _floats(precisions, "precisions", (len(edges), 3, 3))
    size = abs(out).max(axis=(1, 2))
    wrong = ~np.isfinite(out).all(axis=(1, 2)) | (size == 0)
    wrong |= (abs(out - np.swapaxes(out, 1, 2)) > _SYMMETRIC * size[:, None, None]).any(axis=(1, 2))
    wrong[~wrong] = np.linalg.eigvalsh(out[~wrong])[:, 0] < -_SYMMETRIC * size[~wrong]
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        raise InputError(
            f"the precision of edge {row} {_pair(edges[row])} is not a symmetric positive matrix of finite numbers"
        )
    return out


def checked_gravity(n: int, gravity: Any) -> Floats:
    """Unit vectors (n, 3), NaN where unknown."""
    out = _floats(gravity, "gravity", (n, 3))
    unknown = np.isnan(out).all(axis=1)
    length = np.linalg.norm(out, axis=1)
    if (bad := ~unknown & ~(np.isfinite(length) & (length > 0))).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(f"the gravity of camera {row} is {out[row].tolist()}, neither a direction nor NaN")
    return np.ascontiguousarray(out / np.where(unknown, 1.0, length)[:, None])


def _floats(values: Any, what: str, shape: tuple[int, ...]) -> Floats:
    given = np.asarray(values)
    if given.dtype.kind not in "iuf":
        raise InputError(f"{what} must be numbers, not {given.dtype}")
    if given.shape != shape:
        raise InputError(f"{what} must have shape {shape}, not {given.shape}")
    return np.array(given, dtype=np.float64, order="C")


def _pair(edge: Ints) -> str:
    return f"({edge[0]}, {edge[1]})"
