"""COLMAP's reconstructions: poses of images as text or binary, alone or in a folder."""

import importlib.util
import math
import struct
from pathlib import Path

import numpy as np

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import MOST_CAMERAS, Floats
from bench.formats.format import Beginning, CameraIds, Format, RotationsFile, Solution, is_number
from bench.formats.graph import UNIT, GraphFile, Notes, Where, first, from_quaternions
from bench.formats.lines import LINE_COMMENT, Row, parse, read_bytes, rows

TEXT, BINARY = "images.txt", "images.bin"
_LAYOUT = "image_id qw qx qy qz tx ty tz camera_id name"
_POSE = struct.Struct("<I7dI")
_POINT = 24  # bytes of a 2-D point: x, y, id of its 3-D point
_MOST_IMAGES = 2**31 - 1
_DUMMY = ("SIMPLE_PINHOLE", 1000, 1000, (1000.0, 500.0, 500.0))  # a camera where the graph tells of none


def read_images_text(path: Path) -> RotationsFile:
    """Read ``images.txt``: an image's ``image_id qw qx qy qz tx ty tz camera_id name``, then a line of its points.

    The pose maps world to camera as it stands.

    Raises
    ------
    InputError
        Naming the file and line.
    """
    lines: list[Row] = []
    names: list[str] = []
    for line, words in rows(path, LINE_COMMENT):
        if len(words) % 3 or not all(map(is_number, words)):  # not the line of points
            lines.append((line, words[:9]))
            names.append(" ".join(words[9:]))
    table = parse(path, lines, 1, 8, _LAYOUT)
    return _poses(table.ids[:, 0], table.numbers[:, :4], tuple(names), table.where)


def read_images_binary(path: Path) -> RotationsFile:
    """Read ``images.bin``; see `read_images_text`.

    Raises
    ------
    InputError
        Naming the file, where it ends too early or the image is not one.
    """
    data = read_bytes(path)
    ids: list[int] = []
    names: list[str] = []
    quaternions: list[tuple[float, ...]] = []
    try:
        (count,) = struct.unpack_from("<Q", data)
        place = 8
        while len(ids) < count:
            image, *pose, _ = _POSE.unpack_from(data, place)
            place += _POSE.size
            end = data.index(b"\0", place)
            names.append(data[place:end].decode("utf-8"))
            (points,) = struct.unpack_from("<Q", data, end + 1)
            place = end + 9 + _POINT * points
            ids.append(image)
            quaternions.append(tuple(pose[:4]))
        if place > len(data):
            raise ValueError
    except (struct.error, ValueError, OverflowError):
        raise InputError(f"{path}: the file ends in image {len(ids)}, or is no images.bin of COLMAP") from None
    if not ids:
        raise InputError(f"{path}: there is no image in it")
    return _poses(np.array(ids), np.array(quaternions), tuple(names), lambda row: f"{path}: image {ids[row]}")


def read_model(path: Path) -> RotationsFile:
    """Read the images of a reconstruction's folder.

    Raises
    ------
    InputError
        As `read_images_binary` or, where there is no such file, `read_images_text`.
    """
    return read_images_binary(path / BINARY) if (path / BINARY).is_file() else read_images_text(path / TEXT)


def _poses(ids: CameraIds, quaternions: Floats, names: Notes, where: Where) -> RotationsFile:
    _, at, counts = np.unique(ids, return_index=True, return_counts=True)
    if (repeated := first(counts > 1)) is not None:
        raise InputError(f"{where(int(at[repeated]))}: image {ids[at[repeated]]} is there again; keep one of them")
    rotations, notes = from_quaternions(quaternions, where)
    return RotationsFile(ids, rotations, names, notes)


def _write_text(path: Path, solution: Solution, graph: GraphFile | None) -> None:
    lines = [f"# {_LAYOUT}; the second line of each image, its points, is empty"]
    q = so3.to_quaternion(solution.rotations)
    for k in solution.solved.tolist():
        pose = " ".join(map(repr, q[k].tolist()))
        lines += [f"{solution.cameras[k]} {pose} 0 0 0 1 {solution.names[k]}", ""]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _write_model(path: Path, solution: Solution, graph: GraphFile | None) -> None:
    """Write a reconstruction of the solved images, at the origin, with the cameras of a database that was solved."""
    import pycolmap

    model = pycolmap.Reconstruction()
    camera_of: dict[int, int] = {}
    if graph is not None and graph.format == "colmap-database":
        with pycolmap.Database.open(graph.path) as database:
            cameras = database.read_all_cameras()
            camera_of = {image.image_id: image.camera_id for image in database.read_all_images()}
    else:
        kind, width, height, params = _DUMMY
        cameras = [pycolmap.Camera(model=kind, width=width, height=height, params=params, camera_id=1)]
    for camera in cameras:
        model.add_camera_with_trivial_rig(camera)
    for k in solution.solved.tolist():
        number = int(solution.cameras[k])
        image = pycolmap.Image(solution.names[k], camera_id=camera_of.get(number, 1), image_id=number)
        turn = pycolmap.Rotation3d(np.ascontiguousarray(solution.rotations[k]))
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(turn, np.zeros(3)))
    path.mkdir(exist_ok=True)
    model.write(path)


def _writable_model(path: Path, graph: GraphFile | None) -> None:
    if importlib.util.find_spec("pycolmap") is None:
        raise InputError(f"{path}: pycolmap writes reconstructions: python -m pip install 'rotsync-bench[colmap]'")
    if graph is not None and graph.cameras.max() >= _MOST_IMAGES:
        raise InputError(f"{path}: camera {graph.cameras.max()} is too large a number for an image of COLMAP")


def _is_text(beginning: Beginning) -> bool:
    names_columns = b"image_id" in beginning.data.lower() and b"\0" not in beginning.data  # as a database does too
    return names_columns or any(
        len(line) >= 10 and all(map(is_number, line[:9])) and not all(map(is_number, line[9:]))
        for line in beginning.lines
    )


def _is_binary(beginning: Beginning) -> bool:
    if len(beginning.data) < 8 + _POSE.size:
        return False
    (count,) = struct.unpack_from("<Q", beginning.data)
    _, *quaternion, _, _, _, _ = _POSE.unpack_from(beginning.data, 8)
    return 0 < count < MOST_CAMERAS and abs(math.hypot(*quaternion) - 1) < UNIT


def _is_model(beginning: Beginning) -> bool:
    return any((beginning.path / name).is_file() for name in (TEXT, BINARY)) and not beginning.data


FORMATS = (
    Format(
        "colmap-model",
        "COLMAP's reconstruction: a folder with images.bin or images.txt",
        ("/",),
        _is_model,
        rotations=read_model,
        write=_write_model,
        writable=_writable_model,
    ),
    Format(
        "colmap-images",
        f"COLMAP's images.txt: {_LAYOUT}, world to camera",
        (TEXT,),
        _is_text,
        rotations=read_images_text,
        write=_write_text,
    ),
    Format("colmap-binary", "COLMAP's images.bin", (BINARY,), _is_binary, rotations=read_images_binary),
)
