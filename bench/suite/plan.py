"""What was asked for: a job is one cell of an experiment, a plan the jobs of one call of `run`."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


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
    """

    id: str
    dataset: str
    instance: str
    instance_key: str
    method: str
    title: str
    origin: str
    parameters: Mapping[str, Any]
    seed: int
    rounds: int = 0
    source_hash: str = ""
    dataset_origin: str = ""

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
    """

    suite: str
    jobs: tuple[Job, ...]
    missing: tuple[str, ...] = ()
    command: str = ""
    baseline: str = ""

    @property
    def timing(self) -> bool:
        """Whether it is the plan of a timing run."""
        return any(job.rounds for job in self.jobs)


def newest(plans: Sequence[Plan]) -> list[Job]:
    """The newest job of every cell that was ever planned, in the order of planning."""
    if len(plans) == 1:
        return list(plans[0].jobs)
    jobs: dict[tuple[str, str, str, str, int], Job] = {}
    for plan in plans:
        jobs |= {job.cell: job for job in plan.jobs}
    return list(jobs.values())


def encode(plan: Plan) -> dict[str, Any]:
    """As JSON: instances and configured methods once each, jobs as columns that refer to them."""
    instances: dict[tuple[str, ...], int] = {}
    methods: dict[tuple[str, ...], int] = {}
    columns: dict[str, list[Any]] = {name: [] for name in ("id", "instance", "method", "seed", "rounds")}
    for job in plan.jobs:
        instance = (job.dataset, job.instance, job.instance_key, job.dataset_origin)
        method = (job.method, job.title, job.origin, job.source_hash, json.dumps(dict(job.parameters)))
        columns["id"].append(job.id)
        columns["instance"].append(instances.setdefault(instance, len(instances)))
        columns["method"].append(methods.setdefault(method, len(methods)))
        columns["seed"].append(job.seed)
        columns["rounds"].append(job.rounds)
    return {
        "suite": plan.suite,
        "command": plan.command,
        "baseline": plan.baseline,
        "missing": list(plan.missing),
        "instances": [list(instance) for instance in instances],
        "methods": [[*names, json.loads(parameters)] for *names, parameters in methods],
        "jobs": columns,
    }


def decode(content: Mapping[str, Any]) -> Plan:
    """Read what `encode` wrote.

    Raises
    ------
    KeyError, TypeError, ValueError, IndexError
        Where it is something else.
    """
    columns = content["jobs"]
    places = _picked([_strings(entry, 4) for entry in content["instances"]], columns["instance"])
    methods = _picked([_method(*entry) for entry in content["methods"]], columns["method"])
    ids = _keys(_strings(columns["id"], len(columns["id"])))
    _keys([key for _, _, key, _ in content["instances"]])
    rows = zip(ids, places, methods, columns["seed"], columns["rounds"], strict=True)
    jobs = tuple(
        Job(*(key, *place[:3], *method[:4], int(seed), int(rounds), method[4], place[3]))
        for key, place, method, seed, rounds in rows
    )
    missing = _strings(content["missing"], len(content["missing"]))
    suite, command, baseline = _strings([content[name] for name in ("suite", "command", "baseline")], 3)
    return Plan(suite, jobs, missing, command, baseline)


def _method(name: str, title: str, origin: str, source_hash: str, parameters: Any) -> Any:
    _strings([name, title, origin, source_hash], 4)
    return name, title, origin, dict(parameters), source_hash


def _picked(entries: Sequence[Any], chosen: Iterable[int]) -> list[Any]:
    if any(index < 0 for index in chosen):
        raise IndexError("negative")
    return [entries[index] for index in chosen]


def _keys(names: Sequence[str]) -> Sequence[str]:
    """Names of files, which must not lead out of their folder."""
    if not all(name.isalnum() for name in names):
        raise ValueError("a key has characters other than letters and digits")
    return names


def _strings(values: Sequence[Any], count: int) -> tuple[Any, ...]:
    if len(values) != count or not all(isinstance(value, str) for value in values):
        raise TypeError(f"expected {count} strings")
    return tuple(values)
