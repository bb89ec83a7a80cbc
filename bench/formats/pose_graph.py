"""Pose graphs in space and in the plane: g2o's text format, and the older one of TORO."""

import difflib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.core import so3
from bench.core.errors import InputError, shown
from bench.core.problem import Floats
from bench.formats.format import Beginning, Format, Solution
from bench.formats.graph import GraphFile, Ids, Notes, build, distinct, first, from_quaternions
from bench.formats.information import marginal, symmetric
from bench.formats.lines import COMMENT, Row, Table, decode, parse, read_bytes, rows

_TAG = re.compile(r"[A-Z][A-Z0-9_]*(:[A-Z0-9_]+)?")
_LOCKED = 1e-9  # cosine of the pitch below which roll and yaw cannot be told apart
_MISSPELT = 0.9  # similarity to a tag that holds poses


@dataclass(frozen=True)
class Dialect:
    """How one format writes poses: a position, then a rotation.

    Parameters
    ----------
    vertex
        Tag of a pose.
    edges
        Tags of relative poses, and how many words between ids and pose are not the measurement's.
    layout
        Names of the numbers of a pose.
    triangle
        Places of the numbers of an information matrix in its upper triangle, row by row.
    rotations
        Rotations of the numbers (k, width) that follow the position.
    numbers
        The numbers of one rotation (3, 3).
    planar
        Whether the pose is one of the plane.
    """

    vertex: str
    edges: Mapping[str, int]
    layout: str
    triangle: tuple[int, ...]
    rotations: Callable[[Table, Floats], tuple[Floats, Notes]]
    numbers: Callable[[Floats], Floats]
    planar: bool = False

    @property
    def position(self) -> int:
        """Numbers of a position."""
        return 2 if self.planar else 3

    @property
    def width(self) -> int:
        """Numbers of a pose."""
        return len(self.layout.split())


def read_pose_graph(path: Path) -> GraphFile:
    """Read the rotations of a pose graph.

    g2o: ``VERTEX_SE3:QUAT id x y z qx qy qz qw`` and ``EDGE_SE3:QUAT i j x y z qx qy qz qw``, with or
    without information; vertigo's ``EDGE_SE3_SWITCHABLE`` and ``EDGE_SE3_MAXMIX`` have one word more after the ids.
    TORO: ``VERTEX3`` and ``EDGE3`` with ``x y z roll pitch yaw``. In the plane: ``VERTEX_SE2`` and ``EDGE_SE2``,
    TORO's ``VERTEX2`` and ``EDGE2``, with ``x y theta``, read as rotations about z. A pose S_i maps body to world and
    an edge measures S_i^-1 S_j; with R_i = S_i^T, world to body, its rotation is R_i R_j^T as it stands. Vertices are
    initial guesses: only their ids are used. Lines with other tags are left out and counted in a note.

    An information matrix I (translation, then rotation) belongs to the error log(Z^-1 S_i^-1 S_j) of a measurement Z,
    which lives in frame j: the precision in frame i is Z P Z^T, where P is what I says of the rotation when nothing is
    known of the translation. To g2o the error is the vector part of a quaternion, half of a rotation vector, so that
    P / 4 would be in rad^-2; GTSAM takes the same numbers for rad^-2, and so does this reader.

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
        dialect = dialect or DIALECTS.get(tag)
        if dialect and tag in dialect.edges:
            edges.append((line, words[:2] + words[2 + dialect.edges[tag] :]))
        elif dialect and tag == dialect.vertex:
            vertices.append((line, words))
        elif tag in ignored:
            ignored[tag] += 1
        elif tag in DIALECTS or not _TAG.fullmatch(tag) or difflib.get_close_matches(tag, DIALECTS, 1, _MISSPELT):
            raise InputError(
                f"{path}:{line}: {shown(tag)} does not begin a line of g2o, or of TORO where the file began with that"
            )
        else:
            ignored[tag] = 1
    if dialect is None or not edges:
        names = [next(iter(kind.edges)) for kind in ((dialect,) if dialect else _KINDS)]
        raise InputError(f"{path}: there is no {' or '.join(names)} line in this file; is it a pose graph?")
    table, information = _edge_table(path, edges, dialect)
    cameras = _vertex_ids(path, vertices, table, dialect) if vertices else None
    rotations, doubts = dialect.rotations(table, table.numbers[:, dialect.position : dialect.width])
    notes = [f"{count} {tag} lines are left out" for tag, count in ignored.items()]
    if dialect.planar:
        notes.append("a graph in the plane: headings are read as rotations about z")
    precisions = None if information is None else _in_first_frame(information, rotations)
    return build(table.ids, rotations, table.where, cameras=cameras, precisions=precisions, notes=(*notes, *doubts))


def _edge_table(path: Path, edges: list[Row], dialect: Dialect) -> tuple[Table, Floats | None]:
    """The edges, and their information (m, d, d), if they have any."""
    size = len(dialect.triangle)
    layout = f"after the first word of {next(iter(dialect.edges))} i j {dialect.layout}"
    if len(edges[0][1]) <= 2 + dialect.width:
        return parse(path, edges, 2, dialect.width, layout), None
    table = parse(path, edges, 2, dialect.width + size, f"{layout} and {size} of information")
    triangle = table.numbers[:, dialect.width :][:, dialect.triangle]
    return table, symmetric(triangle, 3 if dialect.planar else 6)


def _in_first_frame(information: Floats, rotations: Floats) -> Floats:
    """Precisions (m, 3, 3) in frame i; in the plane, where only a heading can be wrong, the same about all axes."""
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is found where precisions are checked
        if information.shape[1] == 3:
            return marginal(information, slice(2, 3)) * np.eye(3)
        return rotations @ marginal(information, slice(3, 6)) @ rotations.transpose(0, 2, 1)


def _vertex_ids(path: Path, vertices: list[Row], edges: Table, dialect: Dialect) -> Ids:
    layout = f"after the first word of {dialect.vertex} id {dialect.layout}"
    cameras = distinct(parse(path, vertices, 1, dialect.width, layout))
    known = np.isin(edges.ids, cameras)
    if (row := first(~known.all(axis=1))) is not None:
        stranger = edges.ids[row, int(known[row, 0])]
        raise InputError(f"{edges.where(row)}: camera {stranger} has no {dialect.vertex} line in this file")
    return cameras


def _of_quaternions(table: Table, numbers: Floats) -> tuple[Floats, Notes]:
    return from_quaternions(numbers[:, [3, 0, 1, 2]], table.where)


def _of_roll_pitch_yaw(table: Table, angles: Floats) -> tuple[Floats, Notes]:
    if (row := first(~(abs(angles) <= 2 * np.pi).all(axis=1))) is not None:
        raise InputError(f"{table.where(row)}: an angle is not within a full turn; angles are in radians")
    return so3.from_euler(angles), ()


def _of_heading(table: Table, angles: Floats) -> tuple[Floats, Notes]:
    return _of_roll_pitch_yaw(table, np.pad(angles, ((0, 0), (2, 0))))


def _quaternion(rotation: Floats) -> Floats:
    return so3.to_quaternion(rotation)[[1, 2, 3, 0]]


def _roll_pitch_yaw(rotation: Floats) -> Floats:
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    if np.hypot(rotation[0, 0], rotation[1, 0]) < _LOCKED:
        return np.array([np.arctan2(-rotation[1, 2], rotation[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(rotation[2, 1], rotation[2, 2]), pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])


def _heading(rotation: Floats) -> Floats:
    return np.array([np.arctan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])])


def _family(name: str, exact: str) -> dict[str, int]:
    """Tags of relative poses: g2o's own, and those of vertigo, with a switch or a weight before the measurement."""
    return {exact: 0, f"{name}_SWITCHABLE": 1, f"{name}_MAXMIX": 1}


_SPACE, _PLANE = tuple(range(21)), tuple(range(6))
_XYZ, _TORO_PLANE = "x y z", (0, 1, 4, 2, 5, 3)  # TORO: xx, xy, yy, tt, xt, yt
_G2O, _FLAT = _family("EDGE_SE3", "EDGE_SE3:QUAT"), _family("EDGE_SE2", "EDGE_SE2")
_KINDS = (
    Dialect("VERTEX_SE3:QUAT", _G2O, f"{_XYZ} qx qy qz qw", _SPACE, _of_quaternions, _quaternion),
    Dialect("VERTEX3", {"EDGE3": 0}, f"{_XYZ} roll pitch yaw", _SPACE, _of_roll_pitch_yaw, _roll_pitch_yaw),
    Dialect("VERTEX_SE2", _FLAT, "x y theta", _PLANE, _of_heading, _heading, planar=True),
    Dialect("VERTEX2", {"EDGE2": 0}, "x y theta", _TORO_PLANE, _of_heading, _heading, planar=True),
)
DIALECTS = {tag: dialect for dialect in _KINDS for tag in (dialect.vertex, *dialect.edges)}


def _recognises(beginning: Beginning) -> bool:
    return any(line[0] in DIALECTS or line[0].startswith(("VERTEX_", "EDGE_")) for line in beginning.lines)


def _write(path: Path, solution: Solution, graph: GraphFile | None) -> None:
    """Write the file that was solved, with the orientations of its vertices replaced.

    The world is turned so that the first camera that was solved keeps its own orientation, for positions stay as they
    are. What was not solved stays as it is. Vertices that the file lacks are put before it, at the origin.
    """
    assert graph is not None
    text = decode(graph.path, read_bytes(graph.path))
    lines = [(line, COMMENT.split(line, maxsplit=1)[0].split()) for line in text.split("\n")]
    dialect = next(DIALECTS[words[0]] for _, words in lines if words and words[0] in DIALECTS)
    old = {int(words[1]): words for _, words in lines if words and words[0] == dialect.vertex}
    new = {int(solution.cameras[k]): solution.rotations[k].T for k in solution.solved}
    kept = next((camera for camera in sorted(new) if camera in old), None)
    if kept is not None:
        table = parse(graph.path, [(0, old[kept][1:])], 1, dialect.width, dialect.layout)
        before, _ = dialect.rotations(table, table.numbers[:, dialect.position :])
        turn = before[0] @ new[kept].T
        new = {camera: turn @ pose for camera, pose in new.items()}

    def vertex(camera: int, position: list[str]) -> str:
        numbers = dialect.numbers(new[camera])
        return " ".join([dialect.vertex, str(camera), *position, *map(repr, numbers.tolist())])

    out = [vertex(camera, ["0"] * dialect.position) for camera in sorted(set(new) - set(old))]
    for line, words in lines:
        replaced = words and words[0] == dialect.vertex and int(words[1]) in new
        out.append(vertex(int(words[1]), words[2 : 2 + dialect.position]) if replaced else line)
    path.write_text("\n".join(out), encoding="utf-8")


def _writable(path: Path, graph: GraphFile | None) -> None:
    if graph is None or graph.format != "g2o":
        raise InputError(f"{path}: a pose graph is written from a pose graph; choose .txt, .npz or .csv")


FORMATS = (
    Format(
        "g2o",
        "g2o (also of vertigo, RTAB-Map, hdl_graph_slam) and TORO, in space and in the plane",
        (".g2o", ".graph"),
        _recognises,
        graph=read_pose_graph,
        write=_write,
        writable=_writable,
    ),
)
