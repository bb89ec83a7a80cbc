"""Tables of numbers in text files; whatever cannot be read is named with its file and line."""

import math
import re
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.core.errors import InputError, shown

Row = tuple[int, list[str]]

COMMENT = re.compile(r"(?<!\d\.)#")  # not that of 1.#QNAN
LINE_COMMENT = re.compile(r"^\s*#")  # where a name may hold a #
_NAN = re.compile(r"[+-]?([qs]?nan|nan[qs]?|1\.#(ind|inf|[qs]nan))(\([\w-]*\))?0*", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of a text file.

    Parameters
    ----------
    path
        The file.
    lines
        (k,) line number of each row, from 1.
    ids
        (k, a) whole numbers at the start of each row.
    numbers
        (k, b) the other numbers of the row, NaN and infinity included.
    """

    path: Path
    lines: NDArray[np.int64]
    ids: NDArray[np.int64]
    numbers: NDArray[np.float64]

    def where(self, row: int) -> str:
        """``file:line`` of a row."""
        return f"{self.path}:{self.lines[row]}"


def read_bytes(path: Path) -> bytes:
    """All bytes of a file; `InputError` where it is not there, cannot be read or is empty."""
    check_plain(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    if not data.strip():
        raise InputError(f"{path}: the file is empty")
    return data


def check_plain(path: Path) -> None:
    """Refuse what is no plain file: a pipe or a device, to which a link may lead, may never end."""
    if not path.is_file():
        raise InputError(f"{path}: {'it is not a plain file' if path.exists() else 'there is no such file'}")


def decode(path: Path, data: bytes) -> str:
    """Text of bytes that must be UTF-8; `InputError` names the line of the first byte that is not."""
    data = data.removeprefix(b"\xef\xbb\xbf")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"{path}:{line}: byte 0x{data[error.start]:02x} is not plain text; is this the right file?"
        ) from None


def rows(path: Path, comments: re.Pattern[str] = COMMENT) -> Iterator[Row]:
    """Line number and words of each line that is not blank, without its comment."""
    for line, text in enumerate(decode(path, read_bytes(path)).split("\n"), 1):
        words = (comments.split(text, maxsplit=1)[0] if "#" in text else text).split()
        if words:
            yield line, words


def parse(path: Path, source: Iterable[Row], ids: int, numbers: int, layout: str) -> Table:
    """Parse rows of `ids` whole numbers followed by `numbers` numbers.

    Parameters
    ----------
    layout
        What a row holds, in words, for the messages.

    Raises
    ------
    InputError
        Naming the file and line with too few or too many words, or one that is not a number.
    """
    lines, integers, floats = array("q"), array("q"), array("d")
    width = ids + numbers
    for line, words in source:
        if len(words) != width:
            raise InputError(f"{path}:{line}: {len(words)} values where there must be {width}: {layout}")
        try:
            if "_" in "".join(words):  # Python reads 1_000 as a number, no file means it so
                raise ValueError
            integers.extend(map(int, words[:ids]))
            floats.extend(_numbers(words[ids:]))
        except (ValueError, OverflowError):
            raise InputError(f"{path}:{line}: {_culprit(words, ids)}; a line holds {layout}") from None
        lines.append(line)
    if not lines:
        raise InputError(f"{path}: there is no line in it; a line holds {layout}")
    return Table(
        path,
        np.array(lines, dtype=np.int64),
        np.array(integers, dtype=np.int64).reshape(len(lines), ids),
        np.array(floats, dtype=np.float64).reshape(len(lines), numbers),
    )


def _numbers(words: list[str]) -> list[float]:
    try:
        return list(map(float, words))
    except ValueError:
        return list(map(_number, words))


def _number(word: str) -> float:
    """A number as C, C++ or MATLAB may write it: ``-nan(ind)`` and ``1.#QNAN`` are NaN."""
    try:
        return float(word)
    except ValueError:
        if _NAN.fullmatch(word):
            return math.nan
        raise


def _culprit(words: list[str], ids: int) -> str:
    for k, word in enumerate(words):
        try:
            if "_" in word:
                raise ValueError
            if k < ids:
                array("q", [int(word)])
            else:
                _number(word)
        except (ValueError, OverflowError):
            return f"{shown(word)} is not {'a camera id' if k < ids else 'a number'}"
    raise AssertionError("every word was readable")
