"""From edges and matrices as they stand in a file to a `Problem`, or to a message that names the line."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Floats, Problem, WeightsKind, reoriented
from bench.formats.information import usable
from bench.formats.lines import Table

Ids = NDArray[np.int64]
Where = Callable[[int], str]
Notes = tuple[str, ...]

# Frobenius. Two digits, rounded or cut off, leave 3e-2 at most; the six of EGs.txt leave 2e-6.
PRECISION = 3e-2
UNIT = 0.1  # how far the norm of a quaternion may be from 1
_NOTED = 1e-2  # from where on that is worth a word


@dataclass(frozen=True, eq=False)
class GraphFile:
    """A graph read from a file.

    Parameters
    ----------
    problem
        The graph, its cameras numbered from 0, with what the file says of the trust in each measurement.
    cameras
        (n,) the id that the file gives to each camera, ascending.
    notes
        What was left out or must be known of it.
    names
        (n,) what the file calls the cameras, such as images; None where they only have ids.
    path
        The file.
    format
        Name of its format; see `known_formats`.
    """

    problem: Problem
    cameras: Ids
    notes: Notes = ()
    names: tuple[str, ...] | None = None
    path: Path = Path()
    format: str = ""


def build(
    ids: Ids,
    matrices: Floats,
    where: Where,
    *,
    cameras: Ids | None = None,
    weights: Floats | None = None,
    weights_kind: WeightsKind = "count",
    precisions: Floats | None = None,
    gravity: Floats | None = None,
    names: tuple[str, ...] | None = None,
    notes: Notes = (),
) -> GraphFile:
    """Check the edges of a file and number its cameras from 0.

    Parameters
    ----------
    ids
        (m, 2) ends of each edge, as the file names them, in any order; a pair may be there several times.
    matrices
        (m, 3, 3) R_ij = R_i R_j^T to the precision of the file; the nearest rotation is taken.
    where
        The place of a row in the file, such as ``EGs.txt:7``.
    cameras
        (n,) every id of the graph, ascending; both ends of every edge are among them. By default, only those.
    weights, weights_kind, gravity
        As in `Problem`.
    precisions
        (m, 3, 3) in frame i, the first of each row of `ids`. Left out, with a note, where one of them is no positive
        matrix, and without one where all are the same multiple of the identity, which says nothing.
    names
        (n,) of the cameras.

    Raises
    ------
    InputError
        On an edge from a camera to itself, or a matrix that is not a rotation.
    """
    check_ends(ids, where)
    rotations = checked_rotations(matrices, where)
    cameras = np.unique(ids) if cameras is None else cameras
    if precisions is not None:
        precisions, doubts = usable(precisions)
        notes = (*notes, *doubts)
    edges, rotations, precisions = reoriented(np.searchsorted(cameras, ids), rotations, precisions)
    problem = Problem(len(cameras), edges, rotations, weights, weights_kind, precisions, gravity)
    return GraphFile(problem, cameras, notes, names)


def check_ends(ids: Ids, where: Where) -> None:
    """Refuse negative ids and self edges."""
    if (row := first((ids < 0).any(axis=1))) is not None:
        raise InputError(f"{where(row)}: {ids[row].min()} is not a camera id; ids start at 0")
    if (row := first(ids[:, 0] == ids[:, 1])) is not None:
        raise InputError(f"{where(row)}: an edge from camera {ids[row, 0]} to itself; remove it")


def checked_rotations(matrices: Floats, where: Where) -> Floats:
    """Nearest rotations (k, 3, 3); `InputError` where a matrix is not a rotation to `PRECISION`."""
    if (row := first(~np.isfinite(matrices).all(axis=(1, 2)))) is not None:
        raise InputError(f"{where(row)}: the rotation holds NaN or infinity; correct or remove it")
    if (row := first((abs(matrices) > 1 + PRECISION).any(axis=(1, 2)))) is not None:
        entry = abs(matrices[row]).max()
        raise InputError(
            f"{where(row)}: the matrix is not a rotation: it has an entry of size {entry:.4g}, "
            "and none may exceed 1; correct or remove it"
        )
    rotations = so3.project(matrices)
    distance = np.linalg.norm(matrices - rotations, axis=(1, 2))
    if (row := first(distance > PRECISION)) is not None:
        with np.errstate(all="ignore"):  # entries so small that their quotients overflow
            determinant = float(np.linalg.det(matrices[row]))
        what = (
            f"the matrix is a reflection: its determinant is {determinant:.3g} and must be +1"
            if determinant < 0
            else f"the matrix is not a rotation: the nearest one is {distance[row]:.2g} away"
        )
        raise InputError(f"{where(row)}: {what}; correct or remove it")
    return rotations


def from_quaternions(q: Floats, where: Where) -> tuple[Floats, Notes]:
    """Rotations (k, 3, 3) of quaternions (k, 4), scalar first, and a note where some had to be normalised.

    Raises
    ------
    InputError
        Where the norm is further than `UNIT` from 1.
    """
    sane = (abs(q) <= 1 + UNIT).all(axis=1, keepdims=True)  # not NaN, and squares that do not overflow
    off = abs(np.linalg.norm(np.where(sane, q, 0.0), axis=1) - 1)
    if (row := first(off > UNIT)) is not None:
        raise InputError(f"{where(row)}: the quaternion does not have norm 1; correct or remove it")
    count = int((off > _NOTED).sum())
    note = f"{count} of {len(q)} quaternions are up to {100 * off.max(initial=0):.1f} % off norm 1: normalised"
    return so3.from_quaternion(q), (note,) if count else ()


def distinct(table: Table) -> Ids:
    """The ids of a table of one id a row, ascending; `InputError` where one is negative or there twice."""
    ids = table.ids[:, 0]
    cameras, counts = np.unique(ids, return_counts=True)
    if (row := first(ids < 0)) is not None:
        raise InputError(f"{table.where(row)}: {ids[row]} is not a camera id; ids start at 0")
    if (repeated := first(counts > 1)) is not None:
        earlier, later = np.flatnonzero(ids == cameras[repeated])[:2]
        raise InputError(
            f"{table.where(later)}: camera {cameras[repeated]} is there already, at {table.where(earlier)}; "
            "remove one of the two lines"
        )
    return cameras


def first(mask: NDArray[np.bool_] | Any) -> int | None:
    """Index of the first True, or None."""
    found = np.flatnonzero(mask)
    return int(found[0]) if len(found) else None
