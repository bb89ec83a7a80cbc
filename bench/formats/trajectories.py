"""Trajectories: poses of one moving camera, as TUM and KITTI keep them."""

from pathlib import Path

import numpy as np

from bench.core import so3
from bench.formats.format import Format, RotationsFile, Solution
from bench.formats.graph import GraphFile, checked_rotations, from_quaternions
from bench.formats.lines import parse, rows

_WHOLE = 2**53  # up to where whole numbers are exact


def read_tum(path: Path) -> RotationsFile:
    """Read lines ``timestamp tx ty tz qx qy qz qw``, camera to world.

    Where all timestamps are whole and differ, they are the ids of the cameras; otherwise a camera's id is its place in
    the file, from 0, and the timestamp its name.

    Raises
    ------
    InputError
        Naming the file and line.
    """
    table = parse(path, rows(path), 0, 8, "timestamp tx ty tz qx qy qz qw")
    rotations, notes = from_quaternions(table.numbers[:, [7, 4, 5, 6]], table.where)
    rotations = rotations.transpose(0, 2, 1)
    times = table.numbers[:, 0]
    if (abs(times) < _WHOLE).all() and (times == np.round(times)).all() and len(np.unique(times)) == len(times):
        return RotationsFile(times.astype(np.int64), rotations, notes=notes)
    return RotationsFile(np.arange(len(times)), rotations, tuple(map(repr, times.tolist())), notes)


def read_kitti(path: Path) -> RotationsFile:
    """Read lines of twelve numbers: the rows of [R t], camera to world. Line k (from 0) is camera k.

    Raises
    ------
    InputError
        Naming the file and line.
    """
    table = parse(path, rows(path), 0, 12, "the 12 entries of [R t] row by row")
    matrices = table.numbers.reshape(-1, 3, 4)[:, :, :3]
    rotations = checked_rotations(matrices, table.where).transpose(0, 2, 1)
    return RotationsFile(np.arange(len(rotations)), rotations)


def _write_tum(path: Path, solution: Solution, graph: GraphFile | None) -> None:
    q = so3.to_quaternion(solution.rotations[solution.solved].transpose(0, 2, 1))
    lines = ["# camera tx ty tz qx qy qz qw (camera to world)"]
    for camera, (w, x, y, z) in zip(solution.cameras[solution.solved].tolist(), q.tolist(), strict=True):
        lines.append(f"{camera} 0 0 0 {x!r} {y!r} {z!r} {w!r}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


FORMATS = (
    Format(
        "tum",
        "trajectory of TUM: timestamp tx ty tz qx qy qz qw, camera to world",
        (".tum",),
        lambda beginning: beginning.has_line(0, 8),
        rotations=read_tum,
        write=_write_tum,
    ),
    Format(
        "kitti",
        "trajectory of KITTI: the 12 entries of [R t], camera to world",
        (".kitti",),
        lambda beginning: beginning.has_line(0, 12),
        rotations=read_kitti,
    ),
)
