"""Arrays that took long to make, kept in a file for the next time."""

import os
import tempfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench import InputError
from bench.formats import archive


def kept(path: Path, names: Collection[str]) -> dict[str, NDArray[Any]] | None:
    """The arrays of these names in a file that `keep` wrote; None where there is none, or it is damaged."""
    try:
        arrays = archive.load(path, names)
    except InputError:
        return None
    return arrays if arrays.keys() == set(names) else None


def keep(path: Path, arrays: Mapping[str, Any]) -> None:
    """Write arrays to a file: all or, where that is interrupted, nothing.

    Raises
    ------
    InputError
        Where the folder cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=".writing-")
        try:
            with os.fdopen(descriptor, "wb") as file:
                np.savez(file, **arrays)
            os.replace(temporary, path)
        except BaseException:
            os.unlink(temporary)
            raise
    except OSError as error:
        raise InputError(f"{path.parent}: cannot be written: {error.strerror}") from error
