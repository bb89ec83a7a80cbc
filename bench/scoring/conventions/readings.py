"""The mistakes that are known: how a truth, or the measurements, may be meant otherwise than they were read."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.problem import Floats

Ids = NDArray[np.int64]


@dataclass(frozen=True)
class Change:
    """What is written in place of what was read, and what it would mean that this fits: words after 'it seems that'."""

    name: str
    why: str


@dataclass(frozen=True, eq=False)
class Reading:
    """Rotations (k, 3, 3) as they may have been meant, NaN where unknown, and the changes that made them."""

    rotations: Floats
    changes: tuple[Change, ...] = ()


@dataclass(frozen=True, eq=False)
class Turn:
    """Other axes of every camera: F R_i in place of R_i, which makes F R_ij F^T of R_ij."""

    matrix: Floats
    changes: tuple[Change, ...] = ()


CAMERA_TO_WORLD = Change("R_i^T in place of R_i", "the truth is camera to world")
INVERSE = Change("R_ij^T in place of R_ij", "the measurements are of R_j R_i^T")

_KNOWN: dict[tuple[int, ...], str] = {
    (
        1,
        -2,
        -3,
    ): "the truth is in the axes of OpenGL and Bundler and the measurements in those of OpenCV and COLMAP, "
    "or the other way round",
    (-1, -2, 3): "x and y of the cameras are reversed, or z alone, as between a right-handed and a left-handed system",
    (-1, 2, -3): "x and z of the cameras are reversed, or y alone, as between a right-handed and a left-handed system",
    (
        -2,
        -3,
        1,
    ): "the truth is in the axes of a body (x forward, z up) and the measurements in those of a camera (z forward)",
    (3, -1, -2): "the truth is in the axes of a camera (z forward) and the measurements in those of a body "
    "(x forward, z up)",
}
_OTHER = "the truth is in other axes of the camera than the measurements"


def turns() -> list[Turn]:
    """The 24 turns that take coordinate axes to coordinate axes: none, those that have a name, the rest.

    Mirror images need none of their own, as F and -F turn R_ij into the same.
    """
    signed = [
        tuple(s * k for s, k in zip(signs, order, strict=True))
        for order in permutations((1, 2, 3))
        for signs in product((1, -1), repeat=3)
    ]
    named: list[tuple[int, ...]] = [(1, 2, 3), *_KNOWN]
    rest = [code for code in signed if code not in named and np.linalg.det(_matrix(code)) > 0]
    return [Turn(_matrix(named[0])), *(Turn(_matrix(code), (_turned(code),)) for code in [*named[1:], *rest])]


def fitted_turn(matrix: Floats) -> Turn:
    """A turn by any angle."""
    vector = so3.log(matrix)
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle if angle else vector
    name = f"F R_i in place of R_i, F a turn by {np.degrees(angle):.1f} degrees about ({x:.2f}, {y:.2f}, {z:.2f})"
    return Turn(matrix, (Change(name, "a fixed turn lies between the axes of the truth and of the measurements"),))


def of_measurements(rotations: Floats) -> list[Reading]:
    """The measurements as they are, then with their quaternions read in another order."""
    return [Reading(rotations), *_quaternions(rotations, "R_ij", "the measurements'")]


def of_truth(truth: Floats) -> list[Reading]:
    """The truth as it is, then with its quaternions read in another order."""
    return [Reading(truth), *_quaternions(truth, "R_i", "the truth's")]


def reordered(truth: Floats, ids: Ids, names: Sequence[str] | None, table: Floats | None) -> list[Reading]:
    """The truth with its cameras in another order: shifted by an id or by a row, reversed, sorted as text."""
    found = []
    for step, sign in ((-1, "-"), (1, "+")):
        change = Change(f"the truth of camera k {sign} 1 for camera k", "the ids of the truth are shifted by one")
        found.append(Reading(_of_ids(truth, ids, table, ids + step), (change,)))
    for change, rows in _orders(ids, names):
        found.append(Reading(np.where((rows >= 0)[:, None, None], truth[rows], np.nan), (change,)))
    distinct = [truth]
    for reading in found:
        if not any(np.array_equal(reading.rotations, other, equal_nan=True) for other in distinct):
            distinct.append(reading.rotations)
    return [reading for reading in found if any(reading.rotations is other for other in distinct)]


def both_ways(reading: Reading, change: Change) -> tuple[Reading, Reading]:
    """A reading, and the same transposed."""
    return reading, Reading(np.swapaxes(reading.rotations, -1, -2), (*reading.changes, change))


def _matrix(code: tuple[int, ...]) -> Floats:
    matrix = np.zeros((3, 3))
    for row, entry in enumerate(code):
        matrix[row, abs(entry) - 1] = np.sign(entry)
    return matrix


def _turned(code: tuple[int, ...]) -> Change:
    if [abs(entry) for entry in code] == [1, 2, 3]:
        name = f"diag({', '.join(str(int(np.sign(entry))) for entry in code)})"
    else:
        name = "(" + ", ".join(("-" if entry < 0 else "") + "xyz"[abs(entry) - 1] for entry in code) + ") of"
    return Change(f"{name} R_i in place of R_i", _KNOWN.get(code, _OTHER))


def _quaternions(rotations: Floats, symbol: str, whose: str) -> Iterator[Reading]:
    """Quaternions read with the scalar at the wrong end; also those that were inverted after they had been read."""
    known = np.isfinite(rotations).all(axis=(1, 2))
    for inverse, (shift, end) in product((False, True), ((1, "last"), (-1, "first"))):
        given = np.swapaxes(rotations[known], -1, -2) if inverse else rotations[known]
        meant = so3.from_quaternion(np.roll(so3.to_quaternion(given), shift, axis=-1))
        out = np.full_like(rotations, np.nan)
        out[known] = np.swapaxes(meant, -1, -2) if inverse else meant
        name = f"quaternions of {symbol}{'^T' if inverse else ''} with the scalar {end}"
        yield Reading(out, (Change(name, f"{whose} quaternions have the scalar {end} and were read otherwise"),))


def _of_ids(truth: Floats, ids: Ids, table: Floats | None, wanted: Ids) -> Floats:
    """The truth of the ids wanted (n,), NaN where there is none."""
    rows, source = (ids, truth) if table is None else (np.arange(len(table)), table)
    place = np.minimum(np.searchsorted(rows, wanted), len(rows) - 1)
    return np.where((rows[place] == wanted)[:, None, None], source[place], np.nan)


def _orders(ids: Ids, names: Sequence[str] | None) -> Iterator[tuple[Change, Ids]]:
    """For each camera the row of the truth that would be its own, or -1."""
    own = np.arange(len(ids))
    for step, what in ((-1, "before"), (1, "after")):
        rows = np.where((own + step >= 0) & (own + step < len(ids)), own + step, -1)
        yield Change(f"the truth of the camera {what} for each camera", "the truth is shifted by one row"), rows
    yield Change("the truth in reverse order", "the truth lists the cameras in reverse"), own[::-1]
    keys = [[str(camera + base) for camera in ids] for base in (0, 1)] + ([list(names)] if names else [])
    for key in keys:
        order = np.array(sorted(own.tolist(), key=key.__getitem__))
        for rows, where in ((np.argsort(order), "the truth"), (order, "the graph")):
            yield Change("the truth in another order", f"cameras are sorted as text (1, 10, 2) in {where} alone"), rows
