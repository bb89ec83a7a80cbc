"""NumPy archives, written by rename, and read without trust: no pickle, nothing allocated that the file does not hold.

An archive is a zip of arrays, and a few bytes of it can claim any size. Here the header of each array must agree
with the size of its member, and all members together may not be far larger than the file itself.
"""

import math
import os
import zipfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from bench.core.errors import InputError

_NUMBERS = "biufc"
_MOST_RATIO = 100  # zeros compress a thousandfold, measurements hardly at all
_ALWAYS_FINE = 64 * 2**20  # bytes


class _UnreadableError(Exception):
    """Why an array cannot be read, to be completed by the name of the file."""


def load(path: Path, wanted: Collection[str], texts: Collection[str] = ()) -> dict[str, NDArray[Any]]:
    """Read arrays of numbers from a ``.npz``.

    Parameters
    ----------
    path
        The archive.
    wanted
        Names of arrays; those that are not in it are left out, and others in it are not looked at.
    texts
        Which of them hold text (dtype U) instead.

    Raises
    ------
    InputError
        Naming the file, and the array where one is at fault: no such file, not a NumPy archive, damaged, objects
        that would need pickle, or more bytes than such a file can honestly hold.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    try:
        with zipfile.ZipFile(path) as archive:
            return _arrays(archive, wanted, texts, max(_ALWAYS_FINE, _MOST_RATIO * path.stat().st_size))
    except _UnreadableError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:  # a damaged zip or header may fail in any of a dozen ways
        raise InputError(
            f"{path}: cannot be read as a NumPy archive of plain arrays; write it with numpy.savez"
        ) from error


def write(path: Path, arrays: Mapping[str, Any]) -> None:
    """Write an uncompressed ``.npz``; a file of that name is replaced at once, never half."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{os.getpid()}.part")
    with draft.open("wb") as file:
        np.savez(file, **arrays)
    draft.replace(path)


def names(path: Path) -> frozenset[str]:
    """Names of the arrays in a ``.npz``; none where it cannot be read."""
    try:
        with zipfile.ZipFile(path) as archive:
            return frozenset(info.filename.removesuffix(".npy") for info in archive.infolist())
    except (OSError, zipfile.BadZipFile):
        return frozenset()


def _arrays(
    archive: zipfile.ZipFile, wanted: Collection[str], texts: Collection[str], most: int
) -> dict[str, NDArray[Any]]:
    named = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
    members = {name: info for name, info in named.items() if name in wanted}
    total = sum(info.file_size for info in members.values())
    if total > most:
        raise _UnreadableError(f"its arrays claim {total} bytes, far more than such a file can hold; write it again")
    return {name: _array(archive, name, info, name in texts) for name, info in members.items()}


def _array(archive: zipfile.ZipFile, name: str, info: zipfile.ZipInfo, is_text: bool) -> NDArray[Any]:
    with archive.open(info) as file:
        shape, fortran, dtype = _header(file)
        if dtype.kind not in ("U" if is_text else _NUMBERS) or dtype.subdtype is not None:
            rule = "it must hold text" if is_text else "a file of plain arrays holds numbers"
            raise _UnreadableError(f"'{name}' holds {dtype.name}; {rule}")
        size = math.prod(shape) * dtype.itemsize
        if min(shape, default=0) < 0 or size != info.file_size - file.tell():
            raise _UnreadableError(
                f"'{name}' claims the shape {str(shape)[:80]}, but holds something else; write it again"
            )
        data = file.read(size)
        file.read(1)  # to the end, where the checksum is compared
    flat = np.frombuffer(data, dtype=dtype, count=math.prod(shape)).astype(dtype.newbyteorder("="))
    return flat.reshape(shape, order="F" if fortran else "C")


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    version = npy.read_magic(file)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    header: tuple[tuple[int, ...], bool, np.dtype[Any]] = read(file)
    return header
