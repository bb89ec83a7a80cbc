"""COLMAP's database: two-view geometries of pairs of images."""

import math
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from bench.core.errors import InputError, described
from bench.core.problem import Floats
from bench.formats.format import Beginning, Format
from bench.formats.graph import GraphFile, Ids, build, from_quaternions
from bench.formats.lines import check_plain

_PAIR = 2**31 - 1  # pair_id is this times the smaller image id, plus the larger
_USELESS = {0: "undefined", 1: "degenerate", 7: "watermark", 8: "multiple"}
_IDENTITY, _NOWHERE = np.array([1.0, 0, 0, 0]), np.zeros(3)
_REMEDY = (
    "pycolmap.geometric_verification(path, two_view_geometry_options={'compute_relative_pose': True}) makes them, "
    "after Database.clear_two_view_geometries() where there are geometries without"
)


def read_database(path: Path) -> GraphFile:
    """Read the relative poses that COLMAP keeps in ``database.db``, with the counts of inlier matches as weights.

    ``qvec`` (scalar first) and ``tvec`` are the pose of the second image, the one of larger id, in the frame of the
    first: R = R_2 R_1^T. Images are named, and their gravity is taken from the pose priors. Pairs without inliers, or
    whose geometry is undefined, degenerate, a watermark or several motions, are left out and counted in a note.

    Raises
    ------
    InputError
        Naming the file: no database of COLMAP's, or one that holds no relative pose.
    """
    check_plain(path)
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
            return _graph(path, database)
    except (sqlite3.Error, UnicodeError) as error:
        raise InputError(f"{path}: cannot be read as a database of COLMAP: {described(error)}") from error


def _graph(path: Path, database: sqlite3.Connection) -> GraphFile:
    columns = {row[1] for row in database.execute("PRAGMA table_info(two_view_geometries)")}
    if not columns:
        raise InputError(f"{path}: there is no table of two-view geometries in it; is it a database of COLMAP?")
    if "qvec" not in columns:
        raise InputError(f"{path}: this old database keeps no relative poses; make it again with COLMAP 3.6 or later")
    pairs: list[int] = []
    counts: list[int] = []
    poses: list[Floats] = []
    left_out: dict[str, int] = {}
    for pair, rows, config, qvec, tvec in database.execute(
        "SELECT pair_id, rows, config, qvec, tvec FROM two_view_geometries ORDER BY pair_id"
    ):
        q, t = _doubles(qvec, 4), _doubles(tvec, 3)
        if not isinstance(rows, int) or rows <= 0:
            why = "without inlier matches"
        elif config in _USELESS:
            why = f"with the geometry {_USELESS[config]}"
        elif q is None or t is None or ((q == _IDENTITY).all() and (t == _NOWHERE).all()):
            why = "without a relative pose"
        elif not isinstance(pair, int) or not 0 <= pair < _PAIR**2:
            raise InputError(f"{path}: the pair {pair!r:.40} is not one of COLMAP's")
        else:
            pairs.append(pair)
            counts.append(rows)
            poses.append(q)
            continue
        left_out[why] = left_out.get(why, 0) + 1
    notes = tuple(f"{count} pairs {why} are left out" for why, count in left_out.items())
    if not pairs:
        raise InputError(f"{path}: no pair of images has a relative pose ({'; '.join(notes) or 'no pair'}); {_REMEDY}")
    first, second = np.divmod(np.array(pairs, dtype=np.int64), _PAIR)

    def where(row: int) -> str:
        return f"{path}: pair {first[row]} {second[row]}"

    rotations, doubts = from_quaternions(np.array(poses), where)
    cameras = np.unique([first, second])
    return build(
        np.stack([second, first], axis=1),
        rotations,
        where,
        weights=np.array(counts, dtype=np.float64),
        weights_kind="count",
        gravity=_gravity(database, cameras),
        names=_names(path, database, cameras),
        notes=(*notes, *doubts),
    )


def _names(path: Path, database: sqlite3.Connection, cameras: Ids) -> tuple[str, ...]:
    names = dict(database.execute("SELECT image_id, name FROM images").fetchall())
    if (lost := [camera for camera in cameras.tolist() if not isinstance(names.get(camera), str)]) != []:
        raise InputError(f"{path}: image {lost[0]} is in a pair, but has no name in the table of images")
    return tuple(names[camera] for camera in cameras.tolist())


def _gravity(database: sqlite3.Connection, cameras: Ids) -> Floats | None:
    """Gravity (n, 3) in camera axes; None where the database holds none."""
    columns = {row[1] for row in database.execute("PRAGMA table_info(pose_priors)")}
    if not {"gravity", "corr_data_id", "corr_sensor_type"} <= columns:
        return None
    gravity = np.full((len(cameras), 3), np.nan)
    place = {camera: k for k, camera in enumerate(cameras.tolist())}
    for image, blob in database.execute("SELECT corr_data_id, gravity FROM pose_priors WHERE corr_sensor_type = 0"):
        direction = _doubles(blob, 3)
        if image in place and direction is not None and 0 < math.hypot(*direction) < math.inf:
            gravity[place[image]] = direction
    return None if np.isnan(gravity).all() else gravity


def _doubles(blob: Any, count: int) -> Floats | None:
    return np.frombuffer(blob) if isinstance(blob, bytes) and len(blob) == 8 * count else None


def _recognises(beginning: Beginning) -> bool:
    return beginning.data.startswith(b"SQLite format 3\0")


FORMATS = (
    Format(
        "colmap-database",
        "COLMAP's database.db: two-view geometries, weighted by their inlier matches",
        (".db",),
        _recognises,
        graph=read_database,
    ),
)
