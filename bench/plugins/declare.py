"""How a method or a dataset is declared: a frozen dataclass with a decorator, whose fields are its parameters."""

import dataclasses
import importlib.util
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol, TypeVar, cast

import numpy as np

from bench.core.digest import digest
from bench.core.errors import InputError
from bench.core.problem import Estimate, Floats, Information, Instance, Problem
from bench.core.program import program
from bench.plugins.configure import configured, default_of
from bench.plugins.source_hash import hash_of_module

INFO = "__rotsync_info__"
_DEFAULTS: Mapping[str, Any] = MappingProxyType({})
_WANTS_PACKAGES = "requires must be a tuple of top-level packages, such as ('numpy',)"
_ARGUMENTS = {"method": "self, problem, rng", "dataset": "self, data_dir, seed"}
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
    """An instance that is not on disk, with the command that gets it, where that is not the dataset's ``fetch``."""

    name: str
    command: str = ""

    def how(self, dataset: str) -> str:
        """The command that gets it, for an instance of this dataset."""
        return self.command or f"{program()} data fetch {dataset}"


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

    def requires_of(self, parameters: Mapping[str, Any]) -> tuple[str, ...]:
        """Packages that it needs as configured: its attribute `requires`, or what is declared."""
        required = getattr(self.configure(parameters), "requires", self.requires)
        if not _are_packages(required):
            raise InputError(f"{self.kind} '{self.name}': {_WANTS_PACKAGES}")
        return tuple(required)

    def not_installed(self, parameters: Mapping[str, Any] = _DEFAULTS) -> tuple[str, ...]:
        """Packages that are missing for a configuration, found without importing them."""
        return tuple(name for name in self.requires_of(parameters) if importlib.util.find_spec(name) is None)

    def install_hint(self, parameters: Mapping[str, Any] = _DEFAULTS) -> str:
        """The command that installs what is missing."""
        return self.facts.get("install") or f"python -m pip install {' '.join(self.not_installed(parameters))}"

    @property
    def source_hash(self) -> str:
        """Hash of the plug-in's file and of the sibling modules it imports."""
        module = sys.modules[self.cls.__module__]
        return hash_of_module(module)

    def version_of(self, parameters: Mapping[str, Any]) -> str:
        """Hash of what decides its answers besides its parameters: its source, and the weights it was trained to."""
        weights = getattr(self.configure(parameters), "weights_hash", "")
        return digest([self.source_hash, weights]) if weights else self.source_hash

    def fact(self, name: str, configured: Any) -> Any:
        """A fact of a configured object: its attribute of that name, or what the plug-in declares."""
        return getattr(configured, name, self.facts[name])

    def defaults(self) -> dict[str, Any]:
        """Parameters with their default values."""
        return {f.name: default_of(f) for f in dataclasses.fields(self.cls)}

    def configure(self, parameters: Mapping[str, Any]) -> Any:
        """Make the configured object.

        Raises
        ------
        InputError
            On an unknown parameter or a value of the wrong type or range.
        """
        return configured(self.cls, parameters, f"{self.kind} '{self.name}'")


@dataclass(frozen=True)
class MethodInfo(Info):
    """What is known of a method."""

    def varies(self, configured: Method) -> bool:
        """Whether another seed may give another estimate of the same problem."""
        return not self.fact("deterministic", configured) or self.fact("depends_on_labels", configured)

    def configure(self, parameters: Mapping[str, Any]) -> Method:
        """Make the configured method; raises as `Info.configure`."""
        return cast(Method, super().configure(parameters))


@dataclass(frozen=True)
class DatasetInfo(Info):
    """What is known of a dataset."""

    def configure(self, parameters: Mapping[str, Any]) -> Dataset:
        """Make the configured dataset; raises as `Info.configure`."""
        return cast(Dataset, super().configure(parameters))


INFOS: dict[str, type[Info]] = {"method": MethodInfo, "dataset": DatasetInfo}


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
    exact_to_deg: float | None = 1e-6,
    invariant_to_deg: float | None = 1e-3,
    uses: tuple[Information, ...] = (),
    simple_graph: bool = False,
    depends_on_labels: bool = False,
    frames_to_deg: float | None = 0.0,
) -> Callable[[T], T]:
    """Declare a frozen dataclass with a `solve` method as a method.

    Where a fact or what is required depends on the parameters, an attribute of its name overrides what is declared
    (see `Info.fact` and `Info.requires_of`).

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
        How closely it promises to recover small noise-free problems; None promises nothing.
    invariant_to_deg
        How far relabelling cameras, permuting or reversing edges and turning frames may move its answer to a small
        noisy problem; None promises nothing.
    uses
        What it takes of what comes with the measurements: any of "weights", "precisions" and "gravity". The rest is
        not given to it, so that a row never depends on what its table does not say.
    simple_graph
        Whether it needs every pair measured once; parallel edges are then fused before it sees them.
    depends_on_labels
        Whether its answer depends on the names of the cameras, in ways that no seed of its own governs: from the second
        seed on they are permuted, so that the spread over seeds shows how much.
    frames_to_deg
        How much farther turning the frames of cameras, all by one rotation, may move it, as where it judges matrices
        entry by entry; None promises nothing, as where it has learned how cameras are held.
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
        "uses": uses,
        "simple_graph": simple_graph,
        "depends_on_labels": depends_on_labels,
        "frames_to_deg": frames_to_deg,
    }
    return _declare("method", name, title, cite, requires, facts, "solve")


def dataset(
    name: str,
    *,
    title: str,
    cite: str = "",
    requires: tuple[str, ...] = (),
    fetchable: bool = False,
    takes_paths: bool = False,
) -> Callable[[T], T]:
    """Declare a frozen dataclass with a `sources` method as a dataset.

    A `fetchable` dataset has ``fetch(folder)`` and ``verify(data_dir)`` as well. One that `takes_paths` has the
    parameters ``path`` and ``truth``; where a selection is the path of a file or folder, it is meant.
    """
    return _declare(
        "dataset", name, title, cite, requires, {"fetchable": fetchable, "takes_paths": takes_paths}, "sources"
    )


def _declare(
    kind: str, name: str, title: str, cite: str, requires: tuple[str, ...], facts: dict[str, Any], verb: str
) -> Callable[[T], T]:
    def register(cls: T) -> T:
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise TypeError(f"{kind} {name!r}: its name must be one word without quotes and any of [ ] , =")
        if not all(isinstance(text, str) for text in (title, cite)):
            raise TypeError(f"{kind} '{name}': its title and cite must be text")
        if not _are_packages(requires):
            raise TypeError(f"{kind} '{name}': {_WANTS_PACKAGES}")
        made = cls.__dict__.get("__dataclass_params__")
        if made is None:
            raise TypeError(f"{kind} '{name}': put @dataclass(frozen=True) below the @{kind} decorator")
        if not made.frozen:
            raise TypeError(f"{kind} '{name}' could change its parameters as it runs: put @dataclass(frozen=True)")
        if not callable(getattr(cls, verb, None)):
            raise TypeError(f"{kind} '{name}' has no method called {verb}: define {verb}({_ARGUMENTS[kind]})")
        for f in dataclasses.fields(cls):
            if default_of(f) is dataclasses.MISSING:
                raise TypeError(f"{kind} '{name}': parameter '{f.name}' needs a default: write {f.name}: ... = VALUE")
        setattr(cls, INFO, INFOS[kind](kind, name, title, cite, requires, cls, facts=facts))
        return cls

    return register


def _are_packages(requires: object) -> bool:
    return isinstance(requires, tuple) and all(isinstance(name, str) and name.isidentifier() for name in requires)
