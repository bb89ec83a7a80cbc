"""The layout of 1DSfM (Wilson and Snavely 2014): EGs.txt, cc.txt, list.txt and gt_bundle.out."""

from itertools import islice
from pathlib import Path

import numpy as np

from bench.core.errors import InputError, shown
from bench.core.problem import Floats
from bench.core.words import counted
from bench.formats.format import Beginning, Format, RotationsFile
from bench.formats.graph import GraphFile, Ids, build, checked_rotations, distinct, first
from bench.formats.lines import Table, check_plain, decode, parse, read_bytes, rows

EDGES, COMPONENT, IMAGES, BUNDLE = "EGs.txt", "cc.txt", "list.txt", "gt_bundle.out"
_EDGE_LAYOUT = "i j, the 9 entries of R_ij row by row, the 3 of the translation"
_CAMERA_LINES = 5  # focal and distortion, three rows of the rotation, the translation
_SAME_SCENE = "are both files of one scene?"


def read_egs(path: Path) -> GraphFile:
    """Read an ``EGs.txt`` alone: the graph of all its edges.

    A line is ``i j``, the nine entries of R_ij = R_i R_j^T row by row, and the translation (3), which is not
    used. Edges with i > j are reversed. Few digits do no harm: the nearest rotation is taken.

    Raises
    ------
    InputError
        Naming the file and line.
    """
    table = _edge_table(path)
    return build(table.ids, _matrices(table), table.where)


def read_folder(folder: Path) -> GraphFile:
    """Read a scene: the graph of ``EGs.txt`` induced by the cameras of ``cc.txt``, if there is one.

    Raises
    ------
    InputError
        Naming the file and line; also where an id is outside the scene (``list.txt``, or the header of
        ``gt_bundle.out``), and where ``cc.txt`` lists a camera without an edge.
    """
    if not (folder / EDGES).is_file():
        raise InputError(f"{folder}: there is no {EDGES} in this folder; a scene of 1DSfM has one")
    table = _edge_table(folder / EDGES)
    _check_range(table, folder)
    if not (folder / COMPONENT).is_file():
        return build(table.ids, _matrices(table), table.where)
    cameras = _component(folder, table)
    kept = np.flatnonzero(np.isin(table.ids, cameras).all(axis=1))
    if len(kept) == 0:
        raise InputError(f"{folder / COMPONENT}: no edge joins two of these cameras in {EDGES}; {_SAME_SCENE}")
    outside = len(table.ids) - len(kept)
    notes = (f"{counted(outside, 'edge has', 'edges have')} an end outside {COMPONENT}: left out",) if outside else ()

    def where(row: int) -> str:
        return table.where(int(kept[row]))

    return build(table.ids[kept], _matrices(table)[kept], where, cameras=cameras, notes=notes)


def read_bundle(path: Path) -> Floats:
    """Rotations (N, 3, 3) of the cameras of a Bundler v0.3 file, NaN where one was not registered.

    That is where the focal length is 0, whatever the rotation, or the rotation is all zero. They map world to camera,
    in Bundler's axes, as the edges of ``EGs.txt`` do. Points are not read.

    Raises
    ------
    InputError
        On another header, a file that ends too early, or naming the line that does not hold a rotation.
    """
    count = _bundle_size(path)
    lines = _head(path, 2 + _CAMERA_LINES * count)
    if len(lines) < 2 + _CAMERA_LINES * count:
        camera = (len(lines) - 2) // _CAMERA_LINES
        raise InputError(f"{path}:{len(lines)}: the file ends in camera {camera} of {count}; get it again")
    places = [2 + _CAMERA_LINES * camera + k for camera in range(count) for k in range(4)]
    table = parse(path, ((k + 1, lines[k].split()) for k in places), 0, 3, "focal length and distortion, or a rotation")
    blocks = table.numbers.reshape(count, 4, 3)
    matrices = blocks[:, 1:]
    registered = np.flatnonzero((blocks[:, 0, 0] != 0) & (matrices != 0).any(axis=(1, 2)))

    def where(row: int) -> str:
        return table.where(4 * int(registered[row]) + 1)

    truth = np.full_like(matrices, np.nan)
    truth[registered] = checked_rotations(matrices[registered], where)
    return truth


def read_bundle_rotations(path: Path) -> RotationsFile:
    """Read `read_bundle`, or that file of a scene's folder; the camera in place k of it has the id k.

    Raises
    ------
    InputError
        As `read_bundle`.
    """
    rotations = read_bundle(path / BUNDLE if path.is_dir() else path)
    return RotationsFile(np.arange(len(rotations)), rotations)


def _edge_table(path: Path) -> Table:
    return parse(path, rows(path), 2, 12, _EDGE_LAYOUT)


def _matrices(edges: Table) -> Floats:
    return edges.numbers[:, :9].reshape(-1, 3, 3)


def _check_range(edges: Table, folder: Path) -> None:
    """Refuse ids that are not among the images of the scene, as far as the folder says what those are."""
    sizes = {}
    if (folder / IMAGES).is_file():
        sizes[IMAGES] = len(read_bytes(folder / IMAGES).rstrip().split(b"\n"))
    if (folder / BUNDLE).is_file():
        sizes[BUNDLE] = _bundle_size(folder / BUNDLE)
    for name, size in sizes.items():
        if (row := first((edges.ids >= size).any(axis=1))) is not None:
            raise InputError(
                f"{edges.where(row)}: camera {edges.ids[row].max()} is outside {folder / name}, "
                f"which has cameras 0 to {size - 1}; {_SAME_SCENE}"
            )
    if len(set(sizes.values())) > 1:
        raise InputError(
            f"{folder / BUNDLE}:2: {sizes[BUNDLE]} cameras, but {IMAGES} has {sizes[IMAGES]}; {_SAME_SCENE}"
        )


def _component(folder: Path, edges: Table) -> Ids:
    """Ids of ``cc.txt``, ascending, every one of them with an edge."""
    table = parse(folder / COMPONENT, rows(folder / COMPONENT), 1, 0, "one camera id")
    cameras = distinct(table)
    if (row := first(~np.isin(table.ids[:, 0], edges.ids))) is not None:
        raise InputError(f"{table.where(row)}: camera {table.ids[row, 0]} has no edge in {EDGES}; {_SAME_SCENE}")
    return cameras


def _bundle_size(path: Path) -> int:
    lines = _head(path, 2)
    if lines[0].split() != ["#", "Bundle", "file", "v0.3"]:
        raise InputError(f"{path}:1: {shown(lines[0].strip())} is not the header '# Bundle file v0.3'")
    words = lines[1].split() if len(lines) > 1 else []
    if len(words) != 2 or not all(word.isdecimal() and len(word) < 10 for word in words) or int(words[0]) == 0:
        raise InputError(f"{path}:2: this line must hold the number of cameras and the number of points")
    return int(words[0])


def _head(path: Path, count: int) -> list[str]:
    """The first `count` lines, or fewer where the file ends, so that a bundle's points are never read."""
    check_plain(path)
    try:
        with path.open("rb") as file:
            data = b"".join(islice(file, count))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    if not data.strip():
        raise InputError(f"{path}: the file is empty")
    return decode(path, data).removesuffix("\n").split("\n")


def _is_folder(beginning: Beginning) -> bool:
    return any((beginning.path / name).is_file() for name in (EDGES, BUNDLE)) and not beginning.data


def _contents(folder: Path) -> frozenset[str]:
    has = {"graph": folder / EDGES, "rotations": folder / BUNDLE}
    return frozenset(name for name, path in has.items() if path.is_file())


FORMATS = (
    Format(
        "1dsfm-folder",
        "scene of 1DSfM: a folder with EGs.txt and cc.txt, truth in gt_bundle.out",
        ("/",),
        _is_folder,
        graph=read_folder,
        rotations=read_bundle_rotations,
        contents=_contents,
    ),
    Format(
        "egs",
        f"EGs.txt of 1DSfM: {_EDGE_LAYOUT}",
        ("EGs.txt",),
        lambda beginning: beginning.has_line(2, 12),
        graph=read_egs,
    ),
    Format(
        "bundler",
        "gt_bundle.out: Bundler v0.3, rotations in Bundler's axes",
        (".out",),
        lambda beginning: beginning.data.startswith(b"# Bundle"),
        rotations=read_bundle_rotations,
    ),
)
