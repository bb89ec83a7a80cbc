"""Logs of 3DMatch and Redwood: relative poses of fragments, or the poses of a trajectory."""

from pathlib import Path

import numpy as np

from bench.core.errors import InputError
from bench.core.problem import Floats
from bench.core.words import counted
from bench.formats.chain import propagated
from bench.formats.format import Beginning, Format, RotationsFile, is_number
from bench.formats.graph import GraphFile, build, checked_rotations, first
from bench.formats.information import marginal
from bench.formats.lines import Row, Table, parse, rows

_HEAD = "i j n"
_HALF = 0.25  # information of the vector part of a quaternion, half of a rotation vector, in rad^-2
_CONSISTENT_DEG = 0.1


def read_log(path: Path) -> GraphFile:
    """Read relative poses: ``i j n``, then four lines of a matrix that takes fragment j into fragment i.

    Its rotation is R_ij = R_i R_j^T as it stands. Where there is a file of the same name that ends in ``.info``, with
    6 x 6 information matrices of the same pairs, it says how far each is to be trusted: of the position and of the
    vector part of the quaternion of T_ij^-1 T, in frame j (Choi, Zhou and Koltun 2015).

    Raises
    ------
    InputError
        Naming the file and line; also on a trajectory, and on information of other pairs.
    """
    heads, poses = _blocks(path, 4)
    if (heads.ids[:, 0] == heads.ids[:, 1]).all():
        raise InputError(f"{path}: a trajectory, not a graph: it gives the pose of each fragment")
    rotations = poses[:, :3, :3]
    precisions = None
    beside = path.with_suffix(".info")
    if beside != path and beside.is_file():
        others, information = _blocks(beside, 6)
        if others.ids.shape != heads.ids.shape or (others.ids[:, :2] != heads.ids[:, :2]).any():
            raise InputError(f"{beside}: the pairs are not those of {path.name}, in the same order")
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is found where precisions are checked
            own = marginal(information, slice(3, 6)) * _HALF
            precisions = rotations @ own @ rotations.transpose(0, 2, 1)
    return build(heads.ids[:, :2], rotations, heads.where, precisions=precisions)


def read_log_rotations(path: Path) -> RotationsFile:
    """Read the poses of a trajectory (``i i n``, fragment to world), or chain the relative poses of ``gt.log``.

    Relative poses are chained over a tree of the largest component, the cameras outside of it left out; a note says
    how far the other edges are from that.

    Raises
    ------
    InputError
        Naming the file and line.
    """
    heads, poses = _blocks(path, 4)
    ids = heads.ids[:, 0]
    if (ids == heads.ids[:, 1]).all() or (heads.ids[:, 0] + 1 == heads.ids[:, 2]).all():
        cameras, place, counts = np.unique(ids, return_index=True, return_counts=True)
        if (repeated := first(counts > 1)) is not None:
            raise InputError(f"{path}: fragment {cameras[repeated]} has several poses; keep one of them")
        rotations = checked_rotations(poses[:, :3, :3], heads.where)
        return RotationsFile(cameras, rotations[place].transpose(0, 2, 1))
    return _chained(read_log(path))


def _chained(graph: GraphFile) -> RotationsFile:
    inside = np.flatnonzero(graph.problem.components == 0)
    problem, _ = graph.problem.subgraph(inside)
    rotations = propagated(problem)
    notes = [f"chained from {problem.m} relative poses"]
    if outside := graph.problem.n - problem.n:
        notes.append(f"{counted(outside, 'camera is', 'cameras are')} outside the largest component and left out")
    worst = float(np.degrees(problem.residuals(rotations)).max())
    if worst > _CONSISTENT_DEG:
        notes.append(f"the relative poses contradict each other by up to {worst:.1f} degrees")
    return RotationsFile(graph.cameras[inside], rotations, notes=tuple(notes))


def _blocks(path: Path, size: int) -> tuple[Table, Floats]:
    """Heads of three whole numbers, and the matrices (k, size, size) that follow them."""
    lines: list[Row] = list(rows(path))
    step = 1 + size
    heads = parse(path, lines[::step], 3, 0, f"{_HEAD}, before a matrix of {size} lines")
    body = [line for k, line in enumerate(lines) if k % step]
    if len(lines) % step:
        raise InputError(f"{path}:{lines[-1][0]}: the file ends in a matrix, which has {size} lines")
    table = parse(path, body, 0, size, f"a row of a {size} x {size} matrix")
    return heads, table.numbers.reshape(-1, size, size)


def _recognises(beginning: Beginning) -> bool:
    lines = beginning.lines[:5]
    shape = [len(line) for line in lines] == [3, 4, 4, 4, 4]
    return shape and beginning.has_line(3, 0) and all(is_number(x) and float(x) == 0 for x in lines[4][:3])


FORMATS = (
    Format(
        "log",
        "3DMatch's and Redwood's .log (relative poses, with .info beside it), or a trajectory in that form",
        (".log",),
        _recognises,
        graph=read_log,
        rotations=read_log_rotations,
    ),
)
