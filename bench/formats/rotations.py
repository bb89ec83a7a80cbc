"""Absolute rotations as files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from bench.core.errors import InputError
from bench.core.problem import Floats

Ids = NDArray[np.integer[Any]]
Writer = Callable[[Ids, Floats], None]

_COLUMNS = ["camera", *(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))]


def rotations_writer(path: str | Path) -> Writer:
    """What writes rotations to `path`, found before there are any, so that a bad path costs no computation.

    Parameters
    ----------
    path
        ``.npz`` (arrays ``cameras`` and ``rotations``), ``.txt`` (a line a camera: its id and R_i row by row,
        parted by spaces, after a ``#`` line that names the columns) or ``.csv`` (the same with commas and a
        plain header).

    Returns
    -------
    A function of the ids (n,) and the rotations (n, 3, 3), world to camera, NaN where a camera was not solved. It
    writes all digits, and replaces a file that exists only by a whole one.

    Raises
    ------
    InputError
        Where the ending is another or there is no such folder; from the function, where it cannot be written.
    """
    path = Path(path)
    write = _WRITERS.get(path.suffix.lower())
    if write is None:
        raise InputError(f"{path}: rotations are written as .npz, .txt or .csv; choose one of these endings")
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}; make it first")

    def replace(cameras: Ids, rotations: Floats) -> None:
        part = path.with_name(f".{path.name}.part")
        try:
            with part.open("wb") as file:
                write(file, cameras, rotations)
            part.replace(path)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror}") from error
        finally:
            part.unlink(missing_ok=True)

    return replace


def _write_npz(file: BinaryIO, cameras: Ids, rotations: Floats) -> None:
    np.savez(file, cameras=cameras, rotations=rotations)


def _write_txt(file: BinaryIO, cameras: Ids, rotations: Floats) -> None:
    _write_lines(file, cameras, rotations, "# ", " ")


def _write_csv(file: BinaryIO, cameras: Ids, rotations: Floats) -> None:
    _write_lines(file, cameras, rotations, "", ",")


def _write_lines(file: BinaryIO, cameras: Ids, rotations: Floats, lead: str, separator: str) -> None:
    file.write(f"{lead}{separator.join(_COLUMNS)}\n".encode())
    for camera, rotation in zip(cameras.tolist(), rotations.reshape(-1, 9).tolist(), strict=True):
        file.write(f"{separator.join([str(camera), *map(repr, rotation)])}\n".encode())


_WRITERS = {".npz": _write_npz, ".txt": _write_txt, ".csv": _write_csv}
