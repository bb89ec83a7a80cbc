"""The hash of everything of its own that a plug-in runs: a changed kernel makes new jobs of the methods that use it.

Imports are read from the source, wherever they stand, so that those inside a function count too. Followed are the
modules of the plug-in's own package, those beside a plug-in that is a file, and the vocabulary in `bench.core`,
which decides what rotations and problems are.
"""

import ast
import hashlib
import importlib.util
import threading
import types
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import bench

_VOCABULARY = "bench.core"
_PARSING = threading.Lock()  # two threads that make syntax trees can break Python 3.11 (CPython issue 106905)
_BUILT_IN = ("bench.methods", "bench.datasets")


def hash_of_module(module: types.ModuleType) -> str:
    """Hash of a module's file and, transitively, of what it imports of its own and of `bench.core`."""
    file = Path(str(module.__file__))
    waiting = [(module.__name__, file)]
    seen = dict(waiting)
    own = _Own(module.__package__ or "", None if module.__package__ else file.parent)
    while waiting:
        name, path = waiting.pop()
        for found, origin in own.among(_imports(name, path, path.stat().st_mtime_ns)):
            if found not in seen:
                seen[found] = origin
                waiting.append((found, origin))
    return hashlib.sha256(b"".join(seen[name].read_bytes() for name in sorted(seen))).hexdigest()


class _Own:
    """Which modules belong to a plug-in.

    Parameters
    ----------
    package
        The package it is in, or nothing.
    folder
        Of a plug-in that is a file by itself: where modules beside it are.
    """

    def __init__(self, package: str, folder: Path | None) -> None:
        built_in = next((name for name in _BUILT_IN if f"{package}.".startswith(f"{name}.")), None)
        self.roots = tuple(filter(None, (built_in or package.partition(".")[0], _VOCABULARY)))
        self.folder = folder

    def among(self, names: tuple[str, ...]) -> Iterator[tuple[str, Path]]:
        """Modules of its own among names that may be modules, each with its file."""
        for name in names:
            inside = any(f"{name}.".startswith(f"{root}.") for root in self.roots)
            origin = _file_of(name) if inside or self.folder is not None else None
            if origin is not None and (inside or origin.is_relative_to(self.folder or origin)):
                yield name, origin


def _file_of(name: str) -> Path | None:
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, AttributeError, ValueError):  # a name within a module, or a module that is not there
        return None
    return Path(spec.origin) if spec is not None and spec.has_location and spec.origin else None


@lru_cache(maxsize=1024)
def _imports(module: str, file: Path, _modified: int) -> tuple[str, ...]:
    """Every dotted name that a file imports, as far as it may be a module."""
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    names: dict[str, None] = {}
    with _PARSING:
        tree = ast.parse(file.read_bytes())
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= dict.fromkeys(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            names |= dict.fromkeys([base, *(_home(base, alias.name) for alias in node.names)])
    return tuple(names)


def _home(base: str, name: str) -> str:
    """Where an imported name may be a module; what the door of `bench` offers is somewhere behind it."""
    return bench.HOMES.get(name, base) if base == bench.__name__ else f"{base}.{name}"
