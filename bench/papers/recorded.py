"""Results of items that were computed once and kept, because computing them takes hours."""

import csv
from importlib.resources.abc import Traversable
from typing import Any, TypeVar, cast

from bench.core import typed
from bench.core.errors import InputError

T = TypeVar("T")


def read_rows(cls: type[T], folder: Traversable, name: str) -> tuple[T, ...]:
    """Rows of a kept CSV file, whose columns are the fields of a dataclass of text and numbers.

    Raises
    ------
    InputError
        Where there is no such file, or it has not these columns or values.
    """
    path = folder / name
    hints = {field: hint for field, (hint, _) in typed.fields_of(cast(Any, cls)).items()}
    try:
        with path.open(encoding="utf-8") as file:
            return tuple(
                cls(
                    **{
                        field: hint(row[field] or "nan" if hint is float else row[field])
                        for field, hint in hints.items()
                    }
                )
                for row in csv.DictReader(file)
            )
    except OSError as error:
        raise InputError(f"there is no file {path} with recorded results") from error
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise InputError(f"{path} holds no recorded results: {error!r}") from error


def recorded_note(name: str, took: str) -> str:
    """What recorded results are, in a sentence."""
    cost = f" It took {took}." if took else ""
    return (
        f"Recorded, not computed now: an earlier run, kept as {name} among the recorded results, whose README.md "
        f"says how it was made and what has changed since (results/reference).{cost}"
    )
