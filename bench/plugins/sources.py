"""The instances of a dataset, with what its code raises told in one sentence that names file and line."""

import dataclasses
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from bench.core.errors import InputError, shown
from bench.core.problem import Instance, Problem
from bench.plugins.declare import Dataset, DatasetInfo, Missing, Source
from bench.plugins.faults import innermost, located

_END = object()


def sources_of(info: DatasetInfo, configured: Dataset, data_dir: Path | None, seed: int) -> Iterator[Source | Missing]:
    """What a configured dataset has under a seed.

    Raises
    ------
    InputError
        Where its code fails, here or as an instance is loaded, or gives something else.
    """
    with _told(info):
        found = iter(configured.sources(data_dir, seed))
    while True:
        with _told(info):
            source = next(found, _END)
        if source is _END:
            return
        if isinstance(source, Missing):
            yield source
        elif isinstance(source, Source) and isinstance(source.name, str) and isinstance(source.revision, str):
            yield dataclasses.replace(source, load=_Load(info, source))
        else:
            raise InputError(
                f"{_file(info)}: sources of '{info.name}' yields {shown(source)}, not Source(name, revision, load)"
            )


@dataclasses.dataclass(frozen=True)
class _Load:
    info: DatasetInfo
    source: Source

    def __call__(self) -> Instance:
        with _told(self.info):
            instance = self.source.load()
        if wrong := _what_is_wrong(instance):
            raise InputError(f"{_file(self.info)}: what load of '{self.source.name}' returns {wrong}")
        return instance


def _what_is_wrong(instance: object) -> str:
    if not (isinstance(instance, Instance) and isinstance(instance.problem, Problem)):
        return f"is {type(instance).__name__}, not an Instance with a Problem"
    n, m = instance.problem.n, instance.problem.m
    wanted = {"truth": (n, 3, 3), "outliers": (m,), "coherent": (m,)}
    for name, shape in wanted.items():
        given = getattr(instance, name)
        if given is not None and np.shape(given) != shape:
            return f"has {name} of shape {np.shape(given)}; {n} cameras and {m} edges want {shape}"
    return ""


@contextmanager
def _told(info: DatasetInfo) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        if not info.origin.endswith(".py"):
            raise
        file = _file(info)
        raise InputError(f"{innermost(error, Path(file).parent) or file}: {error}") from error
    except (Exception, SystemExit) as error:
        raise InputError(f"dataset '{info.name}': {located(error, _file(info))}") from error


def _file(info: DatasetInfo) -> str:
    return str(sys.modules[info.cls.__module__].__file__)
