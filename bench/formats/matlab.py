"""MATLAB files: arrays of numbers, and the ``RR`` and ``I`` in which codes of rotation averaging keep graphs."""

import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from bench.core.errors import InputError
from bench.core.problem import Floats
from bench.formats.format import Beginning, Format
from bench.formats.graph import GraphFile, build
from bench.formats.lines import read_bytes

_MAGIC, _V73 = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"
_HEADER = 128  # bytes; the last two say the order of bytes
_MATRIX, _COMPRESSED = 14, 15
_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_COMPLEX = 0x0800
_NUMERIC = range(6, 16)  # classes: double, single and whole numbers
_MOST = 2**30  # bytes of a compressed array; ten million edges have less


def read_matlab(path: Path) -> GraphFile:
    """Read relative rotations ``RR`` (3, 3, m) of pairs of cameras ``I`` (2, m), numbered from 1.

    By the convention of Chatterjee and Govindu's code (L1-IRLS, 2013), which others follow, RR(:,:,k) of
    I(:,k) = [i; j] satisfies R_j = RR R_i: it is R_j R_i^T, the transpose of ours.

    Raises
    ------
    InputError
        Naming the file and the array, and the pair (from 1) where one is at fault.
    """
    arrays = read_arrays(path, {"RR": "3 x 3 x m", "I": "2 x m"})
    pairs, matrices = arrays["I"], arrays["RR"]
    if matrices.ndim == 2:
        matrices = matrices[:, :, None]  # MATLAB drops the last axis of a single matrix
    m = matrices.shape[-1]
    if matrices.shape != (3, 3, m) or pairs.shape != (2, m) or m == 0:
        raise InputError(f"{path}: RR must be 3 x 3 x m and I 2 x m, not {matrices.shape} and {pairs.shape}")
    if not ((pairs == np.round(pairs)) & (pairs >= 1) & (pairs < 2**31)).all():
        raise InputError(f"{path}: 'I' must hold the numbers of cameras, from 1")
    ids = pairs.T.astype(np.int64)
    return build(ids, matrices.transpose(2, 1, 0), lambda row: f"{path}: column {row + 1} of I")


def read_arrays(path: Path, shapes: Mapping[str, str]) -> dict[str, Floats]:
    """Read arrays of real numbers, of two or three axes, from a MATLAB file of version 5 to 7.

    Parameters
    ----------
    shapes
        Names of the arrays that must be there, each with its shape, for messages.

    Raises
    ------
    InputError
        Naming the file, and the array that is not there.
    """
    data = read_bytes(path)
    if data.startswith(_V73):
        raise InputError(f"{path}: this is a MATLAB 7.3 file; write it with save(..., '-v7')")
    try:
        arrays = _arrays(data, frozenset(name.encode() for name in shapes))
    except (struct.error, zlib.error, ValueError, OverflowError):
        raise InputError(f"{path}: cannot be read as a MATLAB file; write it again") from None
    if missing := shapes.keys() - arrays.keys():
        wanted = " and ".join(f"{name} is {shape}" for name, shape in shapes.items())
        raise InputError(f"{path}: there is no array of numbers '{min(missing)}' in it; {wanted}")
    return arrays


def _arrays(data: bytes, wanted: frozenset[bytes]) -> dict[str, Floats]:
    """The arrays that are wanted, where they are there and hold real numbers.

    scipy.io.loadmat reads what MATLAB writes; a damaged file may end the process.
    """
    order = "<" if data[_HEADER - 2 : _HEADER] == b"IM" else ">"
    found = {}
    for kind, content in _elements(data[_HEADER:], order):
        if kind == _COMPRESSED:
            kind, content = next(_elements(zlib.decompressobj().decompress(content, _MOST), order), (0, b""))
        if kind != _MATRIX:
            continue
        parts = _elements(content, order)
        flags, shape, name = (part for _, (_, part) in zip(range(3), parts, strict=False))
        (word,) = struct.unpack_from(f"{order}I", flags)
        if name in wanted and word & 0xFF in _NUMERIC and not word & _COMPLEX:
            storage, numbers = next(parts, (0, b""))
            if storage not in _DTYPES:
                raise ValueError
            lengths = struct.unpack(f"{order}{len(shape) // 4}i", shape)
            flat = np.frombuffer(numbers, np.dtype(order + _DTYPES[storage])).astype(np.float64)
            if min(lengths) < 0 or math.prod(lengths) != len(flat) or not 2 <= len(lengths) <= 3:
                raise ValueError
            found[name.decode()] = flat.reshape(lengths, order="F")
    return found


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Type and content of each element: a tag of eight bytes before it, or of four where all fits into eight."""
    place = 0
    while place + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, place)
        if kind >> 16:
            kind, size, start = kind & 0xFFFF, kind >> 16, place + 4
            place += 8
        else:
            start = place + 8
            place = start + size + (0 if kind == _COMPRESSED else -size % 8)
        content = data[start : start + size]
        if len(content) < size:
            raise ValueError
        yield kind, content


def _recognises(beginning: Beginning) -> bool:
    return beginning.data.startswith((_MAGIC, _V73))


FORMATS = (Format("matlab", "MATLAB file with RR (3, 3, m) and I (2, m)", (".mat",), _recognises, graph=read_matlab),)
