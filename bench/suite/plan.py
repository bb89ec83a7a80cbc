"""What was asked for: a job is one cell of an experiment, a plan the jobs of one call of `run`."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from bench.core import typed
from bench.core.errors import InputError
from bench.core.problem import Information
from bench.plugins.selection import Value, format_selection


@dataclass(frozen=True, slots=True)
class Job:
    """One cell of an experiment: an instance, a configured method and a seed.

    Parameters
    ----------
    id
        Hash of the instance's content, the method's parameters and source, and the seed.
    dataset, instance, instance_key
        Selection of the dataset, name of the instance within it, and the folder of the instance.
    method, title, origin, parameters
        The method, the title for tables, the module or file it is in, and the parameters that were given.
    seed
        Seed of the run.
    rounds
        How often a timing run times it; zero for the job of an ordinary run.
    source_hash, dataset_origin
        Hash of the method's source, and the module or file that the dataset is in.
    use
        What the method may use of what comes with the measurements; None for all that it can.
    """

    id: str
    dataset: str
    instance: str
    instance_key: str
    method: str
    title: str
    origin: str
    parameters: Mapping[str, Value]
    seed: int
    rounds: int = 0
    source_hash: str = ""
    dataset_origin: str = ""
    use: tuple[Information, ...] | None = None

    def __post_init__(self) -> None:
        """Refuse keys that would lead out of the folder of a run: they are names of files."""
        if not (self.id.isalnum() and self.instance_key.isalnum()):
            raise ValueError("a key has characters other than letters and digits")

    @property
    def label(self) -> str:
        """The configured method as a selection: ``method[parameter=value]``."""
        return format_selection(self.method, self.parameters)

    @property
    def cell(self) -> tuple[str, str, str, str, int]:
        """What a reader calls this job, however its source or data have changed."""
        return (self.dataset, self.instance, self.method, json.dumps(dict(self.parameters)), self.seed)


@dataclass(frozen=True)
class Plan:
    """The jobs that one call of `run` asked for, no two of them the same, and what it could not find.

    Parameters
    ----------
    suite, jobs, missing, command
        Name of the suite, its jobs, a sentence for what is not on disk, and what was typed.
    baseline
        Of a timing run: the configured method that the others are compared with, as a selection.
    source
        Which of the runs that were merged it came from; empty where it was made in this folder.
    """

    suite: str
    jobs: tuple[Job, ...]
    missing: tuple[str, ...] = ()
    command: str = ""
    baseline: str = ""
    source: str = ""

    @property
    def timing(self) -> bool:
        """Whether it is the plan of a timing run."""
        return any(job.rounds for job in self.jobs)


def newest(plans: Sequence[Plan]) -> list[Job]:
    """The newest job of every cell that was ever planned, in the order of planning.

    Of runs that were merged each has its own newest; where their methods differ in source, the older ones follow as
    ``method@version``, the version being the start of the source's hash.
    """
    if len(plans) == 1:
        return list(plans[0].jobs)
    by_source: dict[str, dict[tuple[str, str, str, str, int], Job]] = {}
    merged: dict[tuple[str, str, str, str, int], Job] = {}
    for plan in plans:
        jobs = {job.cell: job for job in plan.jobs}
        by_source[plan.source] = by_source.get(plan.source, {}) | jobs
        merged |= jobs
    if len(by_source) == 1:
        return list(merged.values())
    return [job for cell, job in merged.items() for job in _versions(job, [of.get(cell) for of in by_source.values()])]


def _versions(newest_one: Job, others: Sequence[Job | None]) -> list[Job]:
    """A job, and once each those of other sources of its method, renamed."""
    of_hash = {job.source_hash: job for job in others if job is not None and job.source_hash != newest_one.source_hash}
    return [newest_one, *(_renamed(job) for job in of_hash.values())]


def _renamed(job: Job) -> Job:
    version = f"@{job.source_hash[:4]}"
    return replace(job, method=job.method + version, title=f"{job.title} {version}")


def notes_on_versions(jobs: Sequence[Job]) -> list[str]:
    """A sentence for every method of which `newest` gave an older version too."""
    older = {job.method: None for job in jobs if job.method.endswith(f"@{job.source_hash[:4]}")}
    return [
        f"{name} is an older version of {name.rpartition('@')[0]}, from another of the runs that were merged"
        for name in older
    ]


@dataclass(frozen=True)
class _Place:
    """What jobs on one instance share."""

    dataset: str
    instance: str
    instance_key: str
    dataset_origin: str


@dataclass(frozen=True)
class _Configured:
    """What jobs of one configured method share."""

    method: str
    title: str
    origin: str
    parameters: Mapping[str, Value]
    source_hash: str
    use: tuple[Information, ...] | None


@dataclass(frozen=True)
class _Columns:
    """An entry for each job; instances and methods by their place in the plan."""

    id: tuple[str, ...]
    instance: tuple[int, ...]
    method: tuple[int, ...]
    seed: tuple[int, ...]
    rounds: tuple[int, ...]


@dataclass(frozen=True)
class _Written:
    """A plan as its file holds it: instances and configured methods once each."""

    suite: str
    command: str
    baseline: str
    missing: tuple[str, ...]
    instances: tuple[_Place, ...]
    methods: tuple[_Configured, ...]
    jobs: _Columns
    source: str = ""


def encode(plan: Plan) -> dict[str, Any]:
    """As JSON can hold it."""
    places: dict[_Place, int] = {}
    methods: dict[tuple[str, ...], int] = {}
    configured: list[_Configured] = []
    rows = []
    for job in plan.jobs:
        place = _Place(job.dataset, job.instance, job.instance_key, job.dataset_origin)
        spelled = (job.method, job.title, job.origin, job.source_hash, job.cell[3], str(job.use))
        if spelled not in methods:
            methods[spelled] = len(methods)
            configured.append(_Configured(job.method, job.title, job.origin, job.parameters, job.source_hash, job.use))
        rows.append((job.id, places.setdefault(place, len(places)), methods[spelled], job.seed, job.rounds))
    columns = _Columns(*map(tuple, zip(*rows, strict=True))) if rows else _Columns((), (), (), (), ())
    shared = tuple(places), tuple(configured), columns
    written = _Written(plan.suite, plan.command, plan.baseline, plan.missing, *shared, plan.source)
    parts = {"instances": list(map(vars, places)), "methods": list(map(vars, configured)), "jobs": vars(columns)}
    return vars(written) | parts  # not `asdict`, which would copy every entry of the columns


def decode(content: Mapping[str, Any], where: str) -> Plan:
    """Read what `encode` wrote.

    Parameters
    ----------
    where
        What it is the content of, for messages.

    Raises
    ------
    InputError
        Where it is something else.
    """
    read = typed.read(_Written, content, where)
    try:
        if min((*read.jobs.instance, *read.jobs.method), default=0) < 0:
            raise IndexError("negative")
        rows = zip(*(getattr(read.jobs, column.name) for column in fields(_Columns)), strict=True)
        jobs = tuple(
            Job(id=key, seed=seed, rounds=rounds, **vars(read.instances[place]), **vars(read.methods[method]))
            for key, place, method, seed, rounds in rows
        )
    except (ValueError, IndexError) as error:
        raise InputError(f"{where}: its jobs do not fit together ({error})") from error
    return Plan(read.suite, jobs, read.missing, read.command, read.baseline, read.source)
