"""What every dataset must satisfy; ``bench check dataset NAME`` and the test suite run the same checks."""

import dataclasses
import hashlib
import itertools
import multiprocessing
import re
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

from bench.core.errors import InputError, shown
from bench.core.problem import ROTATION_TOLERANCE, Floats, Instance
from bench.plugins.catalog import import_origin, infos
from bench.plugins.configure import choices, parameters_of
from bench.plugins.declare import DatasetInfo, Missing, Source
from bench.plugins.sources import sources_of
from bench.running.conformance import BrokenError, Failed, Finding, NotApplicable, findings

MOST = 3  # instances that are loaded
FAR_DEG = 45.0  # an inlier is not that far from the truth
BETTER = 3.0  # how many times closer another convention must be to be named
_PLAIN = re.compile(r"[\w.+-]+")


def check_dataset(info: DatasetInfo, parameters: dict[str, Any], data_dir: Path | None = None) -> Iterator[Finding]:
    """Run every check on a configured dataset, yielding each finding as it is made.

    Raises
    ------
    InputError
        Where its code fails, with file and line.
    """
    return findings(CHECKS, _Kit(info, parameters, data_dir))


class _Identity(NamedTuple):
    """What tables call an instance, its revision, and a hash of its data."""

    place: str
    revision: str
    digest: str


class _Kit:
    """The dataset under test, and its first instances under seed 0, each loaded once."""

    def __init__(self, info: DatasetInfo, parameters: dict[str, Any], data_dir: Path | None) -> None:
        self.info, self.parameters, self.data_dir = info, parameters, data_dir
        self.dialled: list[str] = []  # whom it called
        self.sources: list[Source] = []
        self.instances: list[Instance] = []

    def found(self, seed: int = 0, **changed: Any) -> list[Source | Missing]:
        """Its first instances under a seed, with some parameters changed."""
        configured = self.info.configure(self.parameters | changed)
        with _watched(self.dialled):
            return list(itertools.islice(sources_of(self.info, configured, self.data_dir, seed), MOST))

    def load(self, source: Source) -> Instance:
        with _watched(self.dialled):
            return source.load()

    def each(self) -> Iterator[tuple[Source, Instance]]:
        return zip(self.sources, self.instances, strict=True)


def _instances(kit: _Kit) -> None:
    """There are some, each with a name of its own that a table can hold."""
    found = kit.found()
    kit.sources = [source for source in found if isinstance(source, Source)]
    if not kit.sources:
        missing = [source.how(kit.info.name) for source in found if isinstance(source, Missing)]
        raise BrokenError(f"no instance is on disk; get it with: {missing[0]}" if missing else "sources yields nothing")
    names = [source.name for source in found]
    for name in names:
        if not _PLAIN.fullmatch(name):
            raise Failed(f"the name {shown(name)} has signs other than letters, digits and . + - _")
        if names.count(name) > 1:
            raise Failed(f"two instances are called {shown(name)}")


def _loading(kit: _Kit) -> None:
    """They load, as what their source says."""
    kit.instances = [kit.load(source) for source in kit.sources]
    for source, instance in kit.each():
        for what in ("name", "revision"):
            announced, loaded = getattr(source, what), getattr(instance, what)
            if announced != loaded:
                raise Failed(f"the source's {what} is {shown(announced)}, and the loaded instance's {shown(loaded)}")


def _no_network(kit: _Kit) -> None:
    """A run may be on a machine without; what is downloaded is a matter of ``fetch``."""
    if kit.dialled:
        raise Failed(f"sources or load called {kit.dialled[0]}; download in fetch, and yield Missing until then")


def _truth(kit: _Kit) -> None:
    """Rotations, or NaN where unknown."""
    known = [instance for instance in kit.instances if instance.truth is not None]
    if not known:
        raise NotApplicable("there is no truth")
    for instance in known:
        truth = np.asarray(instance.truth)
        given = truth[~np.isnan(truth).all(axis=(1, 2))]
        off = np.linalg.norm(given @ np.swapaxes(given, -1, -2) - np.eye(3), axis=(1, 2))
        wrong = ~(off < ROTATION_TOLERANCE) | (np.linalg.det(given) < 0)
        if wrong.any():
            raise Failed(f"{instance.name}: {wrong.sum()} of {len(given)} true matrices are no rotations")


def _truth_fits_the_measurements(kit: _Kit) -> None:
    """R_ij is near R_i R_j^T on inliers, and nearer than under another reading of the truth."""
    for instance in kit.instances:
        if instance.truth is None:
            continue
        inliers = np.ones(instance.problem.m, bool) if instance.outliers is None else ~instance.outliers
        as_given, transposed = (
            _median_deg(instance, inliers, truth) for truth in (instance.truth, np.swapaxes(instance.truth, -1, -2))
        )
        if transposed * BETTER < as_given:
            raise Failed(
                f"{instance.name}: R_ij is {as_given:.3g} degrees from R_i R_j^T and {transposed:.3g} from R_i^T R_j "
                "(medians): the truth is camera to world where world to camera is meant; transpose it"
            )
        if instance.outliers is not None and as_given > FAR_DEG:
            raise Failed(f"{instance.name}: the inliers are {as_given:.3g} degrees from the truth (median)")


def _same_seed_same_data(kit: _Kit) -> None:
    """In this process and in another, where hashes and addresses are others."""
    here = [_identity(source, instance) for source, instance in kit.each()]
    again = [source for source in kit.found() if isinstance(source, Source)]
    if here != [_identity(source, kit.load(source)) for source in again]:
        raise Failed("loaded twice under one seed, the data or their revision differ")
    origin = (kit.info.origin, kit.info.name, kit.parameters, kit.data_dir)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        if here != pool.submit(_elsewhere, *origin).result():
            raise Failed("in another process the data or their revision differ")


def _another_seed(kit: _Kit) -> None:
    """Other data where a source is seeded; where it is not, the same."""
    for source, other in zip(kit.sources, kit.found(seed=1), strict=False):
        if isinstance(other, Source):
            same = _digest(kit.load(other)) == _digest(kit.load(source))
            if source.seeded and same:
                raise Failed(f"{source.name}: declared seeded, but seed 1 gives the data of seed 0")
            if not source.seeded and not same:
                raise Failed(f"{source.name}: the data change with the seed; say so with Source(..., seeded=True)")
            if not same and source.revision == other.revision:
                raise Failed(f"{source.name}: seed 1 has other data under the same revision")


def _parameters(kit: _Kit) -> None:
    """One that changes the data changes their revision, and the name or protocol by which tables tell them apart."""
    configured = kit.info.configure(kit.parameters)
    before = [_identity(source, instance) for source, instance in kit.each()]
    tried = 0
    for name, value in parameters_of(configured).items():
        for other in _near(type(configured), name, value):
            try:
                found = [source for source in kit.found(**{name: other}) if isinstance(source, Source)]
                after = [_identity(source, kit.load(source)) for source in found]
            except InputError:  # out of its range
                continue
            tried += 1
            for one, was in itertools.product(after, before):
                if one.digest != was.digest:
                    for what in ("place", "revision"):
                        if getattr(one, what) == getattr(was, what):
                            raise Failed(f"{name}={other} changes the data but not their {what}, {getattr(one, what)}")
            break
    if not tried:
        raise NotApplicable("it has no parameters to change")


CHECKS: tuple[Callable[[_Kit], None], ...] = (
    _instances,
    _loading,
    _no_network,
    _truth,
    _truth_fits_the_measurements,
    _same_seed_same_data,
    _another_seed,
    _parameters,
)


def _near(cls: type, name: str, value: Any) -> list[Any]:
    """Other values of a parameter, to be tried in turn."""
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int):
        return [value + 1, value - 1]
    if isinstance(value, float):
        return [value / 2 + 0.1, value / 2]
    return [other for other in choices(cls, name) if other != value]


def _median_deg(instance: Instance, edges: Any, truth: Floats) -> float:
    residuals = np.degrees(instance.problem.residuals(truth)[edges])
    return float(np.median(residuals[np.isfinite(residuals)])) if np.isfinite(residuals).any() else 0.0


def _digest(instance: Instance) -> str:
    """Hash of every array of an instance."""
    arrays = [getattr(instance.problem, field.name) for field in dataclasses.fields(instance.problem)]
    known = (instance.truth, instance.outliers, instance.coherent)
    made = [b"" if a is None else np.asarray(a).tobytes() for a in (*arrays, *known)]
    return hashlib.sha256(b"\0".join(made)).hexdigest()


def _identity(source: Source, instance: Instance) -> _Identity:
    return _Identity(f"{source.name} ({instance.protocol})", source.revision, _digest(instance))


def _elsewhere(origin: str, name: str, parameters: dict[str, Any], data_dir: Path | None) -> list[_Identity]:
    """What a fresh process loads under seed 0."""
    declared = [info for info in infos(import_origin(origin), "dataset") if info.name == name]
    info = dataclasses.replace(declared[0], origin=origin)
    assert isinstance(info, DatasetInfo)
    kit = _Kit(info, parameters, data_dir)
    return [_identity(source, kit.load(source)) for source in kit.found() if isinstance(source, Source)]


@contextmanager
def _watched(dialled: list[str]) -> Iterator[None]:
    """Note whom the code inside wants to reach, and refuse it."""

    def refuse(*arguments: Any, **_: Any) -> None:
        dialled.append(" ".join(str(part) for part in arguments if not isinstance(part, socket.socket)))
        raise OSError("there is no network while a dataset is checked")

    with mock.patch.object(socket.socket, "connect", refuse), mock.patch.object(socket, "getaddrinfo", refuse):
        yield
