"""What methods and datasets there are: the built-in folders, entry points, and files given with ``--plugin``.

A module that cannot be imported is kept, with the reason; two plug-ins of one name are an error.
"""

import dataclasses
import hashlib
import importlib
import importlib.util
import os
import pkgutil
import sys
import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar, overload

from bench.core.errors import InputError, shown, suggestion
from bench.plugins import selection
from bench.plugins.configure import parameters_of
from bench.plugins.declare import INFO, DatasetInfo, Info, MethodInfo
from bench.plugins.faults import located

PACKAGES = {"method": "bench.methods", "dataset": "bench.datasets"}
ENTRY_POINTS = {"method": "rotsync_bench.methods", "dataset": "rotsync_bench.datasets"}


Declared = TypeVar("Declared", bound=Info)


@dataclass(frozen=True)
class Catalog(Generic[Declared]):
    """Every plug-in of one kind, and the modules that could not be imported."""

    kind: str
    entries: Mapping[str, Declared]
    broken: Mapping[str, str]

    def __getitem__(self, name: str) -> Declared:
        if name in self.entries:
            return self.entries[name]
        for origin, why in self.broken.items():
            if origin.removesuffix(".py").replace("/", ".").split(".")[-1].replace("_", "-") == name:
                raise InputError(f"{self.kind} '{name}' is broken: {why}")
        own = [why for origin, why in self.broken.items() if _is_file(origin)]  # the user's, which may declare it
        raise InputError(
            f"there is no {self.kind} {shown(name)}"
            + (f", and a plug-in is broken: {'; '.join(own)}" if own else suggestion(name, self.entries))
        )

    def __iter__(self) -> Iterator[Declared]:
        return iter(self.entries.values())

    def select(self, texts: Iterable[str]) -> list[tuple[Declared, dict[str, Any]]]:
        """Resolve selections to entries with the parameters given, one pair for each combination, none twice."""
        chosen: dict[str, tuple[Declared, dict[str, Any]]] = {}
        for text in texts:
            parsed = selection.parse(text)
            info = self[parsed.name]
            for combination in parsed.combinations():
                configured = info.configure(combination)
                given = {key: getattr(configured, key) for key in combination}
                chosen.setdefault(selection.format_selection(info.name, parameters_of(configured)), (info, given))
        return list(chosen.values())

    def with_paths(self, text: str, truth: str = "") -> str:
        """The selection that is meant: of the dataset that takes paths, where the text is the path of something."""
        if text in self.entries or not os.path.exists(text):
            return text
        taker = next((info.name for info in self if info.facts.get("takes_paths")), None)
        if taker is None:
            return text
        given = {"path": os.path.abspath(text)} | ({"truth": os.path.abspath(truth)} if truth else {})
        return selection.format_selection(taker, given)

    def one(self, text: str) -> tuple[Declared, dict[str, Any]]:
        """Resolve a selection that stands for one configuration; `InputError` where it stands for several."""
        chosen = self.select([text])
        if len(chosen) != 1:
            raise InputError(f"'{text}' stands for {len(chosen)} configurations where one {self.kind} is taken")
        return chosen[0]


@overload
def catalog(kind: Literal["method"], plugins: Sequence[str | Path] = ()) -> Catalog[MethodInfo]: ...
@overload
def catalog(kind: Literal["dataset"], plugins: Sequence[str | Path] = ()) -> Catalog[DatasetInfo]: ...
@overload
def catalog(kind: str, plugins: Sequence[str | Path] = ()) -> Catalog[Info]: ...
def catalog(kind: str, plugins: Sequence[str | Path] = ()) -> Catalog[Any]:
    """Find the plug-ins of one kind ("method" or "dataset").

    Raises
    ------
    InputError
        On two plug-ins with one name, or a plug-in file that does not exist.
    """
    return scan(kind, [*_builtin(kind), *_entry_points(kind), *(plugin_path(p) for p in plugins)])


def default_method() -> str:
    """The method that solves where none is named; which one that is, the folder of methods says."""
    return str(importlib.import_module(PACKAGES["method"]).DEFAULT)


def scan(kind: str, origins: Iterable[str]) -> Catalog[Any]:
    """Import these modules and files, and list what they declare; `InputError` on two of one name."""
    entries: dict[str, Info] = {}
    broken: dict[str, str] = {}
    for origin in origins:
        try:
            found = infos(import_origin(origin), kind)
        except (Exception, SystemExit) as error:  # a plug-in may fail in any way, and must stay visible
            broken[origin] = located(error, origin)
            continue
        for info in found:
            if info.name in entries:
                raise InputError(
                    f"two {kind}s are called '{info.name}': {entries[info.name].origin} and {origin}; rename one"
                )
            entries[info.name] = dataclasses.replace(info, origin=origin)
    return Catalog(kind, entries, broken)


def _is_file(origin: str) -> bool:
    return origin.endswith(".py")


def import_origin(origin: str) -> types.ModuleType:
    """Import a plug-in module by dotted name, or by path where the origin ends in ``.py``."""
    if not _is_file(origin):
        return importlib.import_module(origin)
    name = f"rotsync_plugin_{hashlib.sha256(origin.encode()).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, origin)
    if spec is None or spec.loader is None:
        raise ImportError(f"cannot load {origin}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _builtin(kind: str) -> list[str]:
    package = importlib.import_module(PACKAGES[kind])
    return [f"{package.__name__}.{m.name}" for m in pkgutil.iter_modules(package.__path__) if m.name[0] != "_"]


def _entry_points(kind: str) -> list[str]:
    return sorted({point.module for point in entry_points(group=ENTRY_POINTS[kind])})


def plugin_path(path: str | Path) -> str:
    """The origin of a plug-in file; `InputError` where there is none."""
    try:
        resolved = Path(path).resolve()
        if resolved.is_file() and resolved.suffix == ".py":
            return str(resolved)
    except (OSError, ValueError):  # a name that no system has
        pass
    raise InputError(f"--plugin {shown(str(path))}: there is no such Python file")


def infos(module: types.ModuleType, kind: str) -> list[Info]:
    """Return the plug-ins of one kind that a module declares itself."""
    classes = [
        value for value in vars(module).values() if isinstance(value, type) and value.__module__ == module.__name__
    ]
    infos = [cls.__dict__[INFO] for cls in classes if INFO in cls.__dict__]
    return [info for info in infos if info.kind == kind]


def method_at(origin: str, name: str) -> MethodInfo | None:
    """The method of a name that a module or file declares; what its import raises comes through."""
    found = (info for info in infos(import_origin(origin), "method") if isinstance(info, MethodInfo))
    return next((info for info in found if info.name == name), None)
