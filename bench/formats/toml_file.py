"""Suites and layouts: TOML files that come with the project under a name, or that the user names by path."""

import math
import tomllib
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from bench.core.errors import InputError, shown, suggestion

# A suite has a thousand bytes. The parser's time grows with the square of the parts of a dotted key.
_MOST_BYTES = 2**18
_MOST_DOTS = 500  # on a line


def names(package: str) -> list[str]:
    """Names of the TOML files that come with a package, sorted."""
    return sorted(Path(f.name).stem for f in resources.files(package).iterdir() if f.name.endswith(".toml"))


def read(kind: str, package: str, name: str) -> tuple[str, dict[str, Any]]:
    """Read a file by its name, or by a path that ends in ``.toml``.

    Parameters
    ----------
    kind
        What such a file is, for messages.
    package
        The package that the named ones come with.

    Returns
    -------
    Its name without folder and ending, and its content.

    Raises
    ------
    InputError
        Where there is no such file, or it is not TOML.
    """
    by_path = name.endswith(".toml")
    file: Traversable = Path(name) if by_path else resources.files(package) / f"{name}.toml"
    if not (by_path or _is_plain(name)) or not _is_file(file):
        near = "" if by_path else suggestion(name, names(package))
        raise InputError(f"there is no {kind} {shown(name)}{near}")
    with file.open("rb") as stream:
        data = stream.read(_MOST_BYTES + 1)
    if len(data) > _MOST_BYTES:
        raise InputError(f"{kind} {name} has more than {_MOST_BYTES} bytes; is this the right file?")
    return Path(file.name).stem, _parsed(f"{kind} {name}", data)


def _is_file(file: Traversable) -> bool:
    try:
        return file.is_file()
    except (OSError, ValueError):  # a name that is too long, or that no system has
        return False


def _is_plain(name: str) -> bool:
    return Path(name).name == name


def _parsed(where: str, data: bytes) -> dict[str, Any]:
    for line, text in enumerate(data.split(b"\n"), 1):
        if text.count(b".") > _MOST_DOTS:
            raise InputError(f"{where}:{line}: more than {_MOST_DOTS} dots; write it on several lines")
    try:
        content = tomllib.loads(data.decode("utf-8"))
        _check_numbers(where, content)
    except InputError:
        raise
    except RecursionError:
        raise InputError(f"{where} is nested too deeply; a table in a table is the most that is needed") from None
    except ValueError as error:  # of TOML's own, of UTF-8, or of a number with thousands of digits
        raise InputError(f"{where} is not valid TOML: {' '.join(str(error).split())[-200:]}") from error
    return content


def _check_numbers(where: str, value: Any) -> None:
    """Refuse what no setting means: NaN, infinity, and whole numbers that TOML itself does not promise to keep."""
    if isinstance(value, dict | list):
        for part in value.values() if isinstance(value, dict) else value:
            _check_numbers(where, part)
    elif isinstance(value, float) and not math.isfinite(value):
        raise InputError(f"{where} holds the number {value}; every number in it must be finite")
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise InputError(f"{where} holds a whole number of more than 64 bits; use a smaller one")
