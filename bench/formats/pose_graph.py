"""Pose graphs in 3-D: g2o's text format, and the older one of TORO."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.core import so3
from bench.core.errors import InputError, shown
from bench.core.problem import Floats
from bench.formats.graph import PRECISION, GraphFile, Ids, build, distinct, first
from bench.formats.lines import Row, Table, parse, rows

_INFORMATION = 21  # upper triangle of a 6 x 6 matrix
_FLAT = {"VERTEX_SE2", "EDGE_SE2", "VERTEX2", "EDGE2"}
_OTHER = {  # lines of g2o that say nothing of a relative rotation
    "FIX",
    "PARAMS_SE3OFFSET",
    "PARAMS_CAMERAPARAMETERS",
    "VERTEX_TRACKXYZ",
    "VERTEX_XYZ",
    "EDGE_SE3_TRACKXYZ",
    "EDGE_SE3_XYZ",
    "EDGE_SE3_PRIOR",
    "EDGE_PROJECT_DEPTH",
    "EDGE_PROJECT_DISPARITY",
}


@dataclass(frozen=True)
class _Dialect:
    """How one of the two formats writes poses: a position (3), then a rotation of `width` numbers."""

    vertex: str
    edge: str
    layout: str
    width: int
    rotations: Callable[[Table], Floats]


def read_pose_graph(path: Path) -> GraphFile:
    """Read the rotations of a pose graph.

    g2o: ``VERTEX_SE3:QUAT id x y z qx qy qz qw`` and ``EDGE_SE3:QUAT i j x y z qx qy qz qw``, with or
    without information. TORO: ``VERTEX3`` and ``EDGE3`` with ``x y z roll pitch yaw``. A pose S_i maps body
    to world and an edge measures S_i^-1 S_j; with R_i = S_i^T, world to body, its rotation is R_i R_j^T as it
    stands. Vertices are initial guesses: only their ids are used. Information matrices are not used.

    Raises
    ------
    InputError
        Naming the file and line; also where an edge names a vertex that the file lacks, if it has any.
    """
    vertices: list[Row] = []
    edges: list[Row] = []
    ignored: dict[str, int] = {}
    dialect = None
    for line, (tag, *words) in rows(path):
        dialect = dialect or _DIALECTS.get(tag)
        if dialect and tag == dialect.edge:
            edges.append((line, words))
        elif dialect and tag == dialect.vertex:
            vertices.append((line, words))
        elif tag in _OTHER:
            ignored[tag] = ignored.get(tag, 0) + 1
        elif not tag.startswith("#"):
            raise InputError(f"{path}:{line}: {_unknown(tag)}")
    if dialect is None or not edges:
        raise InputError(f"{path}: there is no EDGE_SE3:QUAT line in this file; is it a 3-D pose graph?")
    table = _edge_table(path, edges, dialect)
    cameras = _vertex_ids(path, vertices, table, dialect) if vertices else None
    notes = tuple(f"{count} {tag} lines hold no relative pose: left out" for tag, count in ignored.items())
    return build(table.ids, dialect.rotations(table), table.where, cameras=cameras, notes=notes)


def is_pose_graph(path: Path) -> bool:
    """Whether a text file begins as a pose graph does; False where it cannot be read."""
    if not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            return file.read(64).lstrip().startswith((b"VERTEX", b"EDGE"))
    except OSError:
        return False


def _edge_table(path: Path, edges: list[Row], dialect: _Dialect) -> Table:
    pose = 3 + dialect.width
    layout = f"after the first word of {dialect.edge} i j {dialect.layout}"
    if len(edges[0][1]) <= 2 + pose:
        return parse(path, edges, 2, pose, layout)
    return parse(path, edges, 2, pose + _INFORMATION, f"{layout} and {_INFORMATION} of information")


def _vertex_ids(path: Path, vertices: list[Row], edges: Table, dialect: _Dialect) -> Ids:
    layout = f"after the first word of {dialect.vertex} id {dialect.layout}"
    cameras = distinct(parse(path, vertices, 1, 3 + dialect.width, layout))
    known = np.isin(edges.ids, cameras)
    if (row := first(~known.all(axis=1))) is not None:
        stranger = edges.ids[row, int(known[row, 0])]
        raise InputError(f"{edges.where(row)}: camera {stranger} has no {dialect.vertex} line in this file")
    return cameras


def _from_quaternions(table: Table) -> Floats:
    q = table.numbers[:, [6, 3, 4, 5]]
    sane = (abs(q) <= 1 + PRECISION).all(axis=1, keepdims=True)  # not NaN, and squares that do not overflow
    norm = np.linalg.norm(np.where(sane, q, 0.0), axis=1)
    if (row := first(abs(norm - 1) > PRECISION)) is not None:
        raise InputError(f"{table.where(row)}: the quaternion does not have norm 1; correct or remove it")
    return so3.from_quaternion(q)


def _from_roll_pitch_yaw(table: Table) -> Floats:
    angles = table.numbers[:, 3:6]
    if (row := first(~(abs(angles) <= 2 * np.pi).all(axis=1))) is not None:
        raise InputError(f"{table.where(row)}: an angle is not within a full turn; angles are in radians")
    return so3.from_euler(angles)


def _unknown(tag: str) -> str:
    if tag in _FLAT:
        return f"{tag} belongs to a graph in the plane; only 3-D pose graphs can be solved"
    return f"{shown(tag)} does not begin a line of g2o, or of TORO where the file began with that"


_G2O = _Dialect("VERTEX_SE3:QUAT", "EDGE_SE3:QUAT", "x y z qx qy qz qw", 4, _from_quaternions)
_TORO = _Dialect("VERTEX3", "EDGE3", "x y z roll pitch yaw", 3, _from_roll_pitch_yaw)
_DIALECTS = {tag: dialect for dialect in (_G2O, _TORO) for tag in (dialect.vertex, dialect.edge)}
