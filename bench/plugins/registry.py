"""How methods and datasets are declared, found and configured.

A plug-in is a frozen dataclass with a decorator: its fields are its parameters. Discovery looks at the
built-in folders, then at entry points, then at the files given with ``--plugin``; a module that cannot be
imported is kept, with the reason, and two plug-ins of one name are an error.
"""

import dataclasses
import difflib
import hashlib
import importlib
import importlib.util
import pkgutil
import re
import sys
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from bench.core.errors import InputError, described, shown
from bench.core.problem import Estimate, Floats, Instance, Problem
from bench.plugins import selection

PACKAGES = {"method": "bench.methods", "dataset": "bench.datasets"}
ENTRY_POINTS = {"method": "rotsync_bench.methods", "dataset": "rotsync_bench.datasets"}
_INFO = "__rotsync_info__"
_NAME = re.compile(r"[^\s\[\],='\"]+")

T = TypeVar("T", bound=type)


class Method(Protocol):
    """A configured method."""

    def solve(self, problem: Problem, rng: np.random.Generator) -> Floats | Estimate:
        """Absolute rotations (n, 3, 3) of a connected problem, NaN where a camera is not solved."""


@dataclass(frozen=True)
class Source:
    """An instance that has not been loaded.

    Parameters
    ----------
    name
        Name of the instance within its dataset.
    revision
        What determines its bytes: a hash of the files, or of the generator with its parameters and seed.
    load
        Makes the instance.
    seeded
        Whether it changes with the run's seed.
    """

    name: str
    revision: str
    load: Callable[[], Instance]
    seeded: bool = False


@dataclass(frozen=True)
class Missing:
    """An instance that is not on disk, with the command that gets it."""

    name: str
    command: str


class Dataset(Protocol):
    """A configured dataset."""

    def sources(self, data_dir: Path | None, seed: int) -> Iterable[Source | Missing]:
        """The instances, not loaded. `data_dir` is the folder the user named, if any."""


@dataclass(frozen=True)
class Info:
    """What is known of a plug-in without running it."""

    kind: str
    name: str
    title: str
    cite: str
    requires: tuple[str, ...]
    cls: type
    origin: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)

    @property
    def summary(self) -> str:
        """First line of the docstring."""
        return (self.cls.__doc__ or "").strip().split("\n", 1)[0]

    @property
    def not_installed(self) -> tuple[str, ...]:
        """Required packages that are missing, found without importing them."""
        return tuple(name for name in self.requires if importlib.util.find_spec(name) is None)

    @property
    def install_hint(self) -> str:
        """The command that installs what is missing."""
        return self.facts.get("install") or f"python -m pip install {' '.join(self.not_installed)}"

    @property
    def source_hash(self) -> str:
        """Hash of the plug-in's file and of the sibling modules it imports."""
        module = sys.modules[self.cls.__module__]
        return _hash_of_modules(module)

    def fact(self, name: str, configured: Any) -> Any:
        """A fact of a configured object: its attribute of that name, or what the plug-in declares."""
        return getattr(configured, name, self.facts[name])

    def defaults(self) -> dict[str, Any]:
        """Parameters with their default values."""
        return {f.name: _default(f) for f in dataclasses.fields(self.cls)}

    def configure(self, parameters: Mapping[str, Any]) -> Any:
        """Make the configured object.

        Raises
        ------
        InputError
            On an unknown parameter or a value of the wrong type or range.
        """
        hints = typing.get_type_hints(self.cls)
        values = {}
        for key, value in parameters.items():
            if key not in self.defaults():
                raise InputError(
                    f"{self.kind} '{self.name}' has no parameter {shown(key)}{suggestion(key, self.defaults())}"
                )
            values[key] = _coerced(value, hints[key], f"parameter '{key}' of {self.kind} '{self.name}'")
        try:
            return self.cls(**values)
        except ValueError as error:
            raise InputError(f"{self.kind} '{self.name}': {error}") from error


def method(
    name: str,
    *,
    title: str,
    cite: str = "",
    requires: tuple[str, ...] = (),
    install: str = "",
    supervised: bool = False,
    uses_images: bool = False,
    robust: bool = False,
    certifies: bool = False,
    deterministic: bool = True,
    max_cameras: int | None = None,
    exact_to_deg: float = 1e-6,
    invariant_to_deg: float | None = 1e-3,
) -> Callable[[T], T]:
    """Declare a frozen dataclass with a `solve` method as a method.

    Parameters
    ----------
    name, title, cite
        Its id, its name in tables, and the key of its paper in ``methods/references.bib``.
    requires, install
        Packages that `solve` imports, and the command that installs them where ``pip install`` of their names is not.
    supervised, uses_images
        The two columns of the founding paper's Table II.
    robust, certifies
        Whether it is meant to withstand outliers; whether it can prove optimality.
    deterministic
        Whether the same problem always gives the same estimate, whatever the seed.
    max_cameras
        The largest problem it is meant for; larger ones become ``skipped`` rows.
    exact_to_deg
        How closely it promises to recover small noise-free problems.
    invariant_to_deg
        How far relabelling cameras, permuting or reversing edges and turning frames may move its answer to a small
        noisy problem; None promises nothing.

    Where a fact depends on the parameters, an attribute of its name overrides what is declared (see `Info.fact`).
    """
    facts = {
        "install": install,
        "supervised": supervised,
        "uses_images": uses_images,
        "robust": robust,
        "certifies": certifies,
        "deterministic": deterministic,
        "max_cameras": max_cameras,
        "exact_to_deg": exact_to_deg,
        "invariant_to_deg": invariant_to_deg,
    }
    return _declare("method", name, title, cite, requires, facts, "solve")


def dataset(
    name: str, *, title: str, cite: str = "", requires: tuple[str, ...] = (), fetchable: bool = False
) -> Callable[[T], T]:
    """Declare a frozen dataclass with a `sources` method as a dataset.

    A `fetchable` dataset has ``fetch(folder)`` and ``verify(data_dir)`` as well.
    """
    return _declare("dataset", name, title, cite, requires, {"fetchable": fetchable}, "sources")


def _declare(
    kind: str, name: str, title: str, cite: str, requires: tuple[str, ...], facts: dict[str, Any], verb: str
) -> Callable[[T], T]:
    def register(cls: T) -> T:
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise TypeError(f"{kind} {name!r}: its name must be one word without quotes and any of [ ] , =")
        if not all(isinstance(text, str) for text in (title, cite)):
            raise TypeError(f"{kind} '{name}': its title and cite must be text")
        if not isinstance(requires, tuple) or not all(isinstance(r, str) and r.isidentifier() for r in requires):
            raise TypeError(f"{kind} '{name}': requires must be a tuple of top-level packages, such as ('numpy',)")
        if not dataclasses.is_dataclass(cls):
            raise TypeError(f"{kind} '{name}': put @dataclass(frozen=True) below the @{kind} decorator")
        if not callable(getattr(cls, verb, None)):
            raise TypeError(f"{kind} '{name}' has no method called {verb}")
        for f in dataclasses.fields(cls):
            if _default(f) is dataclasses.MISSING:
                raise TypeError(f"{kind} '{name}': parameter '{f.name}' needs a default")
        setattr(cls, _INFO, Info(kind, name, title, cite, requires, cls, facts=facts))
        return cls

    return register


@dataclass(frozen=True)
class Catalog:
    """Every plug-in of one kind, and the modules that could not be imported."""

    kind: str
    entries: Mapping[str, Info]
    broken: Mapping[str, str]

    def __getitem__(self, name: str) -> Info:
        if name in self.entries:
            return self.entries[name]
        for origin, why in self.broken.items():
            if origin.removesuffix(".py").replace("/", ".").split(".")[-1].replace("_", "-") == name:
                raise InputError(f"{self.kind} '{name}' is broken: {why}")
        raise InputError(f"there is no {self.kind} {shown(name)}{suggestion(name, self.entries)}")

    def __iter__(self) -> Iterator[Info]:
        return iter(self.entries.values())

    def select(self, texts: Iterable[str]) -> list[tuple[Info, dict[str, Any]]]:
        """Resolve selections to entries with the parameters given, one pair for each combination, none twice."""
        chosen: dict[str, tuple[Info, dict[str, Any]]] = {}
        for text in texts:
            parsed = selection.parse(text)
            info = self[parsed.name]
            for combination in parsed.combinations():
                configured = info.configure(combination)
                given = {key: getattr(configured, key) for key in combination}
                chosen.setdefault(selection.format_selection(info.name, parameters_of(configured)), (info, given))
        return list(chosen.values())


def catalog(kind: str, plugins: Sequence[str | Path] = ()) -> Catalog:
    """Find the plug-ins of one kind ("method" or "dataset").

    Raises
    ------
    InputError
        On two plug-ins with one name, or a plug-in file that does not exist.
    """
    return scan(kind, [*_builtin(kind), *_entry_points(kind), *(_plugin_path(p) for p in plugins)])


def scan(kind: str, origins: Iterable[str]) -> Catalog:
    """Import these modules and files, and list what they declare; `InputError` on two of one name."""
    entries: dict[str, Info] = {}
    broken: dict[str, str] = {}
    for origin in origins:
        try:
            found = infos(import_origin(origin), kind)
        except (Exception, SystemExit) as error:  # a plug-in may fail in any way, and must stay visible
            broken[origin] = described(error)
            continue
        for info in found:
            if info.name in entries:
                raise InputError(
                    f"two {kind}s are called '{info.name}': {entries[info.name].origin} and {origin}; rename one"
                )
            entries[info.name] = dataclasses.replace(info, origin=origin)
    return Catalog(kind, entries, broken)


def import_origin(origin: str) -> types.ModuleType:
    """Import a plug-in module by dotted name, or by path where the origin ends in ``.py``."""
    if not origin.endswith(".py"):
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


def parameters_of(configured: Any) -> dict[str, Any]:
    """Every parameter of a configured method or dataset, defaults included."""
    return {f.name: getattr(configured, f.name) for f in dataclasses.fields(configured)}


def suggestion(name: str, candidates: Iterable[str]) -> str:
    """``"; did you mean 'x'?"`` for the nearest candidate, or the list of all where none is near."""
    names = sorted(candidate[:80] for candidate in candidates)[:100]
    near = difflib.get_close_matches(name[:80], names, n=1, cutoff=0.5)
    if near:
        return f"; did you mean '{near[0]}'?"
    return f"; there are: {', '.join(names)}" if names else ""


def _builtin(kind: str) -> list[str]:
    package = importlib.import_module(PACKAGES[kind])
    return [f"{package.__name__}.{m.name}" for m in pkgutil.iter_modules(package.__path__) if m.name[0] != "_"]


def _entry_points(kind: str) -> list[str]:
    return sorted({point.module for point in entry_points(group=ENTRY_POINTS[kind])})


def _plugin_path(path: str | Path) -> str:
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
    infos = [cls.__dict__[_INFO] for cls in classes if _INFO in cls.__dict__]
    return [info for info in infos if info.kind == kind]


def _hash_of_modules(module: types.ModuleType) -> str:
    """Hash of a module's file and, transitively, of the modules of its own package that it uses."""
    package = module.__package__ or ""
    waiting, seen = [module], {module.__name__: module}
    while waiting:
        for value in vars(waiting.pop()).values():
            name = value.__name__ if isinstance(value, types.ModuleType) else getattr(value, "__module__", None)
            if isinstance(name, str) and package and name.startswith(f"{package}.") and name not in seen:
                seen[name] = sys.modules[name]
                waiting.append(sys.modules[name])
    digest = hashlib.sha256()
    for name in sorted(seen):
        digest.update(Path(str(seen[name].__file__)).read_bytes())
    return digest.hexdigest()


def _default(f: "dataclasses.Field[Any]") -> Any:
    return f.default_factory() if f.default_factory is not dataclasses.MISSING else f.default


def _coerced(value: Any, hint: Any, what: str) -> Any:
    """`value` as the type of a field, or an error that says what the field takes."""
    options = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    for option in options:
        if typing.get_origin(option) is typing.Literal:
            if value in typing.get_args(option):
                return value
        elif option in (None, type(None)):
            if value is None:
                return None
        elif option is float and isinstance(value, int | float) and not isinstance(value, bool):
            if isinstance(value, float) or abs(value) < 2**1023:  # a larger whole number is no float
                return float(value)
        elif option is str and isinstance(value, int | float) and not isinstance(value, bool):
            return str(value)
        elif isinstance(value, option) and not (option is int and isinstance(value, bool)):
            return value
    takes = " or ".join(_spelled(option) for option in options)
    given = selection.format_value(value)[:80]
    raise InputError(f"{what} takes {takes}, not {given if given.isprintable() else shown(value)}")


def _spelled(option: Any) -> str:
    if typing.get_origin(option) is typing.Literal:
        return " or ".join(selection.format_value(v) for v in typing.get_args(option))
    return "none" if option in (None, type(None)) else option.__name__
