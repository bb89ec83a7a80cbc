"""From edges and matrices as they stand in a file to a `Problem`, or to a message that names the line."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Floats, Problem, oriented
from bench.formats.lines import Table

Ids = NDArray[np.int64]
Where = Callable[[int], str]

# Frobenius. The six digits of EGs.txt leave 2e-6, and a file with two digits still passes.
PRECISION = 1e-2


@dataclass(frozen=True, eq=False)
class GraphFile:
    """A graph read from a file.

    Parameters
    ----------
    problem
        The graph, its cameras numbered from 0.
    cameras
        (n,) the id that the file gives to each camera, ascending.
    notes
        What was left out or must be known of it.
    """

    problem: Problem
    cameras: Ids
    notes: tuple[str, ...] = ()


def build(
    ids: Ids,
    matrices: Floats,
    where: Where,
    *,
    cameras: Ids | None = None,
    weights: Floats | None = None,
    notes: tuple[str, ...] = (),
) -> GraphFile:
    """Check the edges of a file and number its cameras from 0.

    Parameters
    ----------
    ids
        (m, 2) ends of each edge, as the file names them, in any order.
    matrices
        (m, 3, 3) R_ij = R_i R_j^T to the precision of the file; the nearest rotation is taken.
    where
        The place of a row in the file, such as ``EGs.txt:7``.
    cameras
        (n,) every id of the graph, ascending; both ends of every edge are among them. By default, only those.
    weights
        (m,) positive, or None.

    Raises
    ------
    InputError
        On an edge from a camera to itself, a pair that is there twice (in either order), or a matrix that is
        not a rotation.
    """
    check_pairs(ids, where)
    rotations = checked_rotations(matrices, where)
    cameras = np.unique(ids) if cameras is None else cameras
    edges, rotations = oriented(np.searchsorted(cameras, ids), rotations)
    return GraphFile(Problem(len(cameras), edges, rotations, weights), cameras, notes)


def check_pairs(ids: Ids, where: Where) -> None:
    """Refuse negative ids, self edges, and pairs that are there twice in either order."""
    if (row := first((ids < 0).any(axis=1))) is not None:
        raise InputError(f"{where(row)}: {ids[row].min()} is not a camera id; ids start at 0")
    if (row := first(ids[:, 0] == ids[:, 1])) is not None:
        raise InputError(f"{where(row)}: an edge from camera {ids[row, 0]} to itself; remove it")
    ends = np.sort(ids, axis=1)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    repeated = (np.diff(ends[order], axis=0) == 0).all(axis=1)
    if repeated.any():
        later = order[1:][repeated]
        row = int(later.min())
        earlier = int(order[int(np.flatnonzero(order == row)[0]) - 1])
        raise InputError(
            f"{where(row)}: the edge between cameras {ids[row, 0]} and {ids[row, 1]} is there already, "
            f"at {where(earlier)}; keep one of them"
        )


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
        determinant = float(np.linalg.det(matrices[row]))
        what = (
            f"the matrix is a reflection: its determinant is {determinant:.3g} and must be +1"
            if determinant < 0
            else f"the matrix is not a rotation: the nearest one is {distance[row]:.2g} away"
        )
        raise InputError(f"{where(row)}: {what}; correct or remove it")
    return rotations


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
