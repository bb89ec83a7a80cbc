"""Numbers that papers have printed."""

import csv
import io
from importlib.resources.abc import Traversable

from bench.errors import InputError

SCENE = "scene"
FACTS = ("n_cameras", "edges_percent", "hardness")  # what a table prints of a scene, by the names that we score
SOURCE = "source"


def read_published(folder: Traversable, name: str) -> list[dict[str, str]]:
    """Rows of a published table, each cell as the paper prints it, "" where it prints none.

    Parameters
    ----------
    folder, name
        A CSV file with the columns ``scene, n_cameras, edges_percent, hardness``, one for each method, and ``source``.

    Raises
    ------
    InputError
        Where the file is missing, a column is, or a cell is not a number.
    """
    path = folder / name
    if not path.is_file():
        raise InputError(f"there is no file {path} with the published numbers")
    reader = csv.DictReader(io.StringIO(path.read_text(encoding="utf-8")))
    for column in (SCENE, *FACTS, SOURCE):
        if column not in (reader.fieldnames or ()):
            raise InputError(f"{path} has no column '{column}'")
    rows = []
    for row in reader:
        for column, text in row.items():
            if column not in (SCENE, SOURCE) and text and not _is_number(text):
                raise InputError(f"{path}:{reader.line_num}: '{text}' in column '{column}' is not a number")
        rows.append(row)
    return rows


def methods_of(rows: list[dict[str, str]]) -> list[str]:
    """The columns that are methods, in the paper's order."""
    return [column for column in rows[0] if column not in (SCENE, *FACTS, SOURCE)] if rows else []


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
