"""Files of graphs and of rotations: what a user can hand to the benchmark or take away, checked line by line.

`read_graph` and `read_rotations` tell the format by what a file holds; `rotations_writer` writes what a method found.
Whatever a file's own convention is, it is converted here to R_ij = R_i R_j^T, with R_i world to camera. A module that
reads or writes a format declares it in its ``FORMATS``; here they are only listed.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from bench.core.errors import InputError
from bench.core.problem import Floats
from bench.formats import (
    colmap_database,
    colmap_model,
    matlab,
    npz,
    one_dsfm,
    open3d,
    pose_graph,
    registration_log,
    relative_poses,
    rotations,
    trajectories,
)
from bench.formats.format import Beginning, CameraIds, Format, RotationsFile, Solution
from bench.formats.graph import GraphFile

__all__ = [
    "Format",
    "GraphFile",
    "RotationsFile",
    "holds",
    "known_formats",
    "read_graph",
    "read_rotations",
    "rotations_writer",
]

Writer = Callable[[CameraIds, Floats, Mapping[str, Any]], None]

_FORMATS: tuple[Format, ...] = (
    *one_dsfm.FORMATS,
    *pose_graph.FORMATS,
    *npz.FORMATS,
    *colmap_database.FORMATS,
    *colmap_model.FORMATS,
    *relative_poses.FORMATS,
    *registration_log.FORMATS,
    *open3d.FORMATS,
    *matlab.FORMATS,
    *trajectories.FORMATS,
    *rotations.FORMATS,
)


def known_formats() -> tuple[Format, ...]:
    """Every format that is read or written, in the order in which they are tried."""
    return _FORMATS


def read_graph(path: str | Path) -> GraphFile:
    """Read a graph of relative rotations from a file, or a folder, of any format in `known_formats`.

    Raises
    ------
    InputError
        Where there is no such file, or naming the file and the line that cannot be used.
    """
    path = Path(path)
    form = _format_of(path, "graph")
    assert form.graph is not None
    return replace(form.graph(path), path=path, format=form.name)


def read_rotations(path: str | Path) -> RotationsFile:
    """Read absolute rotations, such as ground truth or what `solve` wrote, of any format in `known_formats`.

    Raises
    ------
    InputError
        Where there is no such file, or naming the file and the line that cannot be used.
    """
    path = Path(path)
    form = _format_of(path, "rotations")
    assert form.rotations is not None
    return form.rotations(path)


def rotations_writer(path: str | Path, source: GraphFile | None = None) -> Writer:
    """What writes rotations to `path`, found before there are any, so that a bad path costs no computation.

    Parameters
    ----------
    path
        Its ending, its name, or that it is a folder (or has no ending), says in which format of `known_formats`.
    source
        The graph that was solved: it knows the names of the cameras, and some formats are written from its file.

    Returns
    -------
    A function of the ids (n,), the rotations (n, 3, 3), world to camera, NaN where a camera was not solved, and arrays
    and texts by name, such as ``edge_weights``, ``residuals`` and ``stop_reason``, which an ``.npz`` keeps and other
    formats do not. It writes all digits, and replaces a file that exists only by a whole one.

    Raises
    ------
    InputError
        Where no format is written so or there is no such folder; from the function, where it cannot be written.
    """
    path = Path(path)
    form = _by_hint(path, [form for form in _FORMATS if form.write])
    if form is None or form.write is None:
        endings = ", ".join(hint for form in _FORMATS if form.write for hint in form.hints if hint != "/")
        raise InputError(f"{path}: rotations are written as {endings} or a folder; choose one of these endings")
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}; make it first")
    form.writable(path, source)
    write = form.write

    def replaced(cameras: CameraIds, rotations: Floats, extras: Mapping[str, Any]) -> None:
        names = source.names if source is not None and source.names is not None else None
        solution = Solution(cameras, rotations, names or tuple(map(str, cameras.tolist())), extras)
        is_folder = form.hint(path) == "/"
        part = path if is_folder else path.with_name(f".{path.name}.part")
        try:
            write(part, solution, source)
            if not is_folder:
                part.replace(path)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror}") from error
        finally:
            if not is_folder:
                part.unlink(missing_ok=True)

    return replaced


def holds(path: str | Path) -> frozenset[str]:
    """Which of "graph" and "rotations" can be read from a file or folder; neither where it is of no known format."""
    path = Path(path)
    try:
        beginning = Beginning.of(path)
    except (OSError, InputError):
        return frozenset()
    kinds = [form.holds(path) for form in _FORMATS if form.recognises(beginning)]
    return frozenset().union(*kinds)


def _format_of(path: Path, holds: str) -> Format:
    """The format of what is at `path`, by its content or, where that is not clear, by its name."""
    try:
        if not path.exists():
            raise InputError(f"{path}: there is no such file or folder")
        beginning = Beginning.of(path)
    except OSError as error:  # such as a name that is too long
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    able = [form for form in _FORMATS if getattr(form, holds)]
    found = next((form for form in able if form.recognises(beginning)), None) or _by_hint(path, able)
    if found is not None:
        return found
    other = next((form for form in _FORMATS if form.recognises(beginning)), None)
    kind = "a graph of relative rotations" if holds == "graph" else "absolute rotations"
    if other is not None:
        raise InputError(f"{path}: this is {other.name} ({other.summary}), which holds no {kind.removeprefix('a ')}")
    if not beginning.data.strip() and not path.is_dir():
        raise InputError(f"{path}: the file is empty")
    known = ", ".join(form.name for form in able)
    raise InputError(
        f"{path}: cannot tell what kind of file this is; {kind} can be read from {known}, see `bench data formats`"
    )


def _by_hint(path: Path, forms: list[Format]) -> Format | None:
    best = max(forms, key=lambda form: len(form.hint(path)))
    return best if best.hint(path) else None
