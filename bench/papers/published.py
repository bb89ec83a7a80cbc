"""Numbers that papers have printed."""

import csv
import io
import math
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable

from bench.core.errors import InputError, shown

SCENE = "scene"
FACTS = ("n_cameras", "edges_percent", "hardness")  # what a table prints of a scene, by the names that we score
SOURCE = "source"


@dataclass(frozen=True)
class Sources:
    """Folders of numbers: those that papers have printed, and our own recorded runs."""

    published: Traversable
    reference: Traversable

    @classmethod
    def shipped(cls) -> "Sources":
        """What comes with the project."""
        return cls(*(resources.files(f"bench.results.{name}") for name in ("published", "reference")))


def read_published(folder: Traversable, name: str) -> list[dict[str, str]]:
    """Rows of a published table, each cell as the paper prints it, "" where it prints none.

    Parameters
    ----------
    folder, name
        A CSV file with the columns ``scene, n_cameras, edges_percent, hardness``, one for each method, and ``source``.

    Raises
    ------
    InputError
        Where the file is missing or not CSV, a column is missing or there twice, a row has fewer or more cells than
        there are columns, or a cell is not a number.
    """
    path = folder / name
    if not path.is_file():
        raise InputError(f"there is no file {path} with the published numbers")
    try:
        return _checked_rows(str(path), io.StringIO(path.read_text(encoding="utf-8")))
    except (csv.Error, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not a CSV file: {error}") from error


def _checked_rows(path: str, text: io.StringIO) -> list[dict[str, str]]:
    reader = csv.reader(text)
    columns = next(reader, [])
    for column in (SCENE, *FACTS, SOURCE):
        if column not in columns:
            raise InputError(f"{path} has no column '{column}'")
    if len(set(columns)) < len(columns):
        raise InputError(f"{path}:1: two columns have the same name")
    rows = []
    for cells in filter(None, reader):
        if len(cells) != len(columns):
            raise InputError(f"{path}:{reader.line_num}: {len(cells)} cells where there are {len(columns)} columns")
        row = dict(zip(columns, cells, strict=True))
        for column, cell in row.items():
            if column not in (SCENE, SOURCE) and cell and not _is_number(cell):
                raise InputError(f"{path}:{reader.line_num}: {shown(cell)} in column {shown(column)} is not a number")
        rows.append(row)
    return rows


def methods_of(rows: list[dict[str, str]]) -> list[str]:
    """The columns that are methods, in the paper's order."""
    return [column for column in rows[0] if column not in (SCENE, *FACTS, SOURCE)] if rows else []


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text)) and "_" not in text
    except ValueError:
        return False
