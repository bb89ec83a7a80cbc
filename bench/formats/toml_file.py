"""Suites and layouts: TOML files that come with the project under a name, or that the user names by path."""

import tomllib
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from bench.core.errors import InputError, shown, suggestion


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
    if not (by_path or Path(name).name == name) or not _is_file(file):
        near = "" if by_path else suggestion(name, names(package))
        raise InputError(f"there is no {kind} {shown(name)}{near}")
    return Path(file.name).stem, parse(f"{kind} {name}", file.read_bytes())


def parse(where: str, data: bytes) -> dict[str, Any]:
    """Content of a TOML file; `InputError` where it is none, naming it as `where`."""
    try:
        return tomllib.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # of TOML's own, of UTF-8, of a number with thousands of digits
        raise InputError(f"{where} is not valid TOML: {' '.join(str(error).split())[-200:]}") from error


def _is_file(file: Traversable) -> bool:
    try:
        return file.is_file()
    except (OSError, ValueError):  # a name that is too long, or that no system has
        return False
