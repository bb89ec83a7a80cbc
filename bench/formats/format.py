"""What a format is: how a file of it is told from others, and what can be read from it or written to it."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core.problem import Floats
from bench.formats.graph import GraphFile
from bench.formats.lines import check_plain

_SAMPLE = 2**16  # bytes
_LINES = 8
_COMMENT = re.compile(r"(?:^|(?<=\s))#")  # a name may hold a #

CameraIds = NDArray[np.integer[Any]]


@dataclass(frozen=True, eq=False)
class RotationsFile:
    """Absolute rotations read from a file.

    Parameters
    ----------
    cameras
        (n,) the id that the file gives to each camera, or its place in the file, from 0, where that gives none.
    rotations
        (n, 3, 3) world to camera; NaN where the file says that a camera was not solved.
    names
        (n,) what the file calls the cameras, such as images; None where they only have ids.
    notes
        What must be known of it.
    """

    cameras: CameraIds
    rotations: Floats
    names: tuple[str, ...] | None = None
    notes: tuple[str, ...] = ()

    def of(self, graph: "GraphFile | RotationsFile") -> Floats:
        """Rotations (n, 3, 3) of the cameras of another file, by name where both files have names, by id otherwise.

        NaN where this file does not have a camera.
        """
        by_name = self.names is not None and graph.names is not None
        mine: list[Any] = list(self.names or ()) if by_name else self.cameras.tolist()
        wanted: list[Any] = list(graph.names or ()) if by_name else graph.cameras.tolist()
        place = {key: k for k, key in enumerate(mine)}
        found = np.array([place.get(key, -1) for key in wanted])
        rotations = self.rotations[found]
        rotations[found < 0] = np.nan
        return rotations


@dataclass(frozen=True, eq=False)
class Solution:
    """What is written: absolute rotations, and what else a method says.

    Parameters
    ----------
    cameras
        (n,) ids.
    rotations
        (n, 3, 3) world to camera, NaN where a camera was not solved.
    names
        (n,) of the cameras; their ids where the graph has none.
    extras
        Arrays and texts by name, such as ``edge_weights``, ``residuals`` and ``stop_reason``.
    """

    cameras: CameraIds
    rotations: Floats
    names: tuple[str, ...]
    extras: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def solved(self) -> NDArray[np.intp]:
        """Rows of the cameras that have a rotation."""
        return np.flatnonzero(np.isfinite(self.rotations).all(axis=(1, 2)))


@dataclass(frozen=True)
class Beginning:
    """The first bytes of a file, by which its format is told; none of a folder."""

    path: Path
    data: bytes = b""

    @classmethod
    def of(cls, path: Path) -> "Beginning":
        """The first bytes of what is at `path`."""
        if path.is_dir():
            return cls(path)
        check_plain(path)
        with path.open("rb") as file:
            return cls(path, file.read(_SAMPLE))

    @cached_property
    def lines(self) -> list[list[str]]:
        """Words of the first lines that are neither blank nor comments; none where the file is not text."""
        if b"\0" in self.data:
            return []
        text = self.data.decode("utf-8-sig", "replace")
        words = (_COMMENT.split(line, maxsplit=1)[0].split() for line in text.split("\n"))
        return [line for line, _ in zip(filter(None, words), range(_LINES), strict=False)]

    def has_line(self, ids: int, numbers: int) -> bool:
        """Whether one of the first lines is `ids` whole numbers, then `numbers` numbers."""
        return any(
            len(line) == ids + numbers and all(map(_is_whole, line[:ids])) and all(map(is_number, line[ids:]))
            for line in self.lines
        )


def is_number(word: str) -> bool:
    """Whether a word is a number, NaN and infinity included."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def _is_whole(word: str) -> bool:
    return word.removeprefix("-").isdecimal()


@dataclass(frozen=True)
class Format:
    """One format.

    Parameters
    ----------
    name
        Short, such as ``g2o``.
    summary
        What it is and who writes it.
    hints
        Endings or names of such files: what is to be written is told by them alone, and so is what is to be read
        where its content is not clear. ``/`` stands for a folder.
    recognises
        Whether a file is of this format, by what it holds.
    graph, rotations
        Readers of relative and of absolute rotations, or None.
    write
        Writes a solution to a path; the graph that was solved, if it came from a file, says more of its cameras.
    writable
        Raises `InputError` where a solution of that graph cannot be written; called before there is one.
    contents
        What a file holds, where not every file of this format holds all that can be read from it.
    """

    name: str
    summary: str
    hints: tuple[str, ...]
    recognises: Callable[[Beginning], bool]
    graph: Callable[[Path], GraphFile] | None = None
    rotations: Callable[[Path], RotationsFile] | None = None
    write: Callable[[Path, Solution, GraphFile | None], None] | None = None
    writable: Callable[[Path, GraphFile | None], None] = lambda path, graph: None
    contents: Callable[[Path], frozenset[str]] | None = None

    def holds(self, path: Path) -> frozenset[str]:
        """Which of "graph" and "rotations" a file of this format holds."""
        able = frozenset(name for name in ("graph", "rotations") if getattr(self, name))
        return able if self.contents is None else able & self.contents(path)

    def hint(self, path: Path) -> str:
        """The longest hint that fits a path; empty where none does."""
        name = path.name.lower()
        is_folder = path.is_dir() or (not path.suffix and not path.is_file())
        fitting = [hint for hint in self.hints if (is_folder if hint == "/" else name.endswith(hint.lower()))]
        return max(fitting, key=len, default="")
