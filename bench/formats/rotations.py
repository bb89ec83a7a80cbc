"""Absolute rotations as text, as `solve` writes them, and where rotations are written to."""

from collections.abc import Callable
from pathlib import Path

from bench.formats.format import Beginning, Format, RotationsFile, Solution
from bench.formats.graph import GraphFile, distinct
from bench.formats.lines import parse, rows
from bench.formats.npz import known_rotations

_COLUMNS = ["camera", *(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))]


def read_rotations_text(path: Path) -> RotationsFile:
    """Read a line a camera: its id and R_i row by row, parted by spaces or commas; NaN where it was not solved.

    Raises
    ------
    InputError
        Naming the file and line.
    """
    split = ((line, " ".join(words).replace(",", " ").split()) for line, words in rows(path))
    lines = ((line, words) for line, words in split if words[:1] != _COLUMNS[:1])
    table = parse(path, lines, 1, 9, " ".join(_COLUMNS))
    distinct(table)
    rotations = known_rotations(table.numbers.reshape(-1, 3, 3), table.where)
    return RotationsFile(table.ids[:, 0], rotations)


def _writer(lead: str, separator: str) -> Callable[[Path, Solution, GraphFile | None], None]:
    def write(path: Path, solution: Solution, graph: GraphFile | None) -> None:
        lines = [lead + separator.join(_COLUMNS)]
        for camera, rotation in zip(solution.cameras.tolist(), solution.rotations.reshape(-1, 9).tolist(), strict=True):
            lines.append(separator.join([str(camera), *map(repr, rotation)]))
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")

    return write


def _is_text(beginning: Beginning) -> bool:
    return beginning.has_line(1, 9)


def _is_csv(beginning: Beginning) -> bool:
    words = [" ".join(line).replace(",", " ").split() for line in beginning.lines]
    return any(line == _COLUMNS for line in words)


FORMATS = (
    Format(
        "rotations",
        "text: camera, then R row by row (9), world to camera",
        (".txt",),
        _is_text,
        rotations=read_rotations_text,
        write=_writer("# ", " "),
    ),
    Format(
        "csv",
        "the same with commas and a header",
        (".csv",),
        _is_csv,
        rotations=read_rotations_text,
        write=_writer("", ","),
    ),
)
