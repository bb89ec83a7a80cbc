"""Relative poses between named images, as GLOMAP and COLMAP write them."""

from pathlib import Path

from bench.formats.format import Beginning, Format, is_number
from bench.formats.graph import GraphFile, build, from_quaternions
from bench.formats.lines import LINE_COMMENT, Row, parse, rows

_NUMBERS = 7
_LAYOUT = "name1 name2 qw qx qy qz tx ty tz"


def read_relative_poses(path: Path) -> GraphFile:
    """Read lines ``name1 name2 qw qx qy qz tx ty tz``: the pose of the second camera in the frame of the first.

    A point goes from the first frame to the second by x2 = R x1 + t, so that R = R_2 R_1^T. Cameras are numbered in
    the order of their names.

    Raises
    ------
    InputError
        Naming the file and line.
    """
    lines = list(rows(path, LINE_COMMENT))
    names = sorted({name for _, words in lines for name in words[:2]})
    number = {name: str(k) for k, name in enumerate(names)}
    numbered: list[Row] = [(line, [*(number[name] for name in words[:2]), *words[2:]]) for line, words in lines]
    table = parse(path, numbered, 2, _NUMBERS, _LAYOUT)
    rotations, notes = from_quaternions(table.numbers[:, :4], table.where)
    return build(table.ids[:, ::-1], rotations, table.where, names=tuple(names), notes=notes)


def _recognises(beginning: Beginning) -> bool:
    return any(len(line) == 2 + _NUMBERS and all(map(is_number, line[2:])) for line in beginning.lines)


FORMATS = (
    Format(
        "relative-poses",
        f"relative poses of GLOMAP and COLMAP: {_LAYOUT}",
        ("relpose.txt", "relative_poses.txt"),
        _recognises,
        graph=read_relative_poses,
    ),
)
