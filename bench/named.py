"""Suites and layouts: TOML files that come with the project under a name, or that the user names by path."""

import tomllib
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from bench.errors import InputError
from bench.registry import suggestion


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
    file: Traversable = Path(name) if name.endswith(".toml") else resources.files(package) / f"{name}.toml"
    if not file.is_file():
        near = "" if name.endswith(".toml") else suggestion(name, names(package))
        raise InputError(f"there is no {kind} '{name}'{near}")
    try:
        return Path(file.name).stem, tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{kind} {name} is not valid TOML: {error}") from error
