"""What a run leaves on disk: plans, instances, records and estimates.

    RUN/plans/<time>-<hash>.json       which jobs were asked for, by one call of `run`
    RUN/instances/<key>/               problem.npz, truth.npz, instance.json
    RUN/records/<id>.json              one job each, written last and by rename: it is there whole or not at all
    RUN/estimates/<id>.npz             the arrays that the method returned, float64, unrounded
    RUN/work/                          what jobs in progress write

No file is shared between jobs, so there is no lock. A job's id is a hash of everything that determines its
result; where several plans name the same cell of the experiment, the newest plan's job is the one that counts.
"""

import dataclasses
import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from bench import npz
from bench.arrays import load_estimate, load_problem, save_problem
from bench.errors import InputError, shown
from bench.problem import Estimate, Instance

SCHEMA = 1


def digest(value: Any) -> str:
    """Hash of a JSON-like value, 24 hexadecimal digits."""
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


@dataclass(frozen=True)
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

    @property
    def cell(self) -> tuple[str, str, str, str, int]:
        """What a reader calls this job, however its source or data have changed."""
        return (self.dataset, self.instance, self.method, json.dumps(dict(self.parameters)), self.seed)


@dataclass(frozen=True)
class Plan:
    """The jobs that one call of `run` asked for, and what it could not find.

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


class Store:
    """The folder of a run."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @classmethod
    def open(cls, folder: Path) -> "Store":
        """Open a run for reading.

        Raises
        ------
        InputError
            Where the folder holds no run.
        """
        if not (folder / "plans").is_dir():
            raise InputError(f"{folder} is not the folder of a run; make one with: python -m bench run --out {folder}")
        return cls(folder)

    def add_plan(self, plan: Plan) -> None:
        """Keep a plan."""
        content = dataclasses.asdict(plan) | {"schema": SCHEMA}
        moment = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")
        _write_json(self.folder / "plans" / f"{moment}-{digest(content)[:8]}.json", content)

    def plans(self) -> list[Plan]:
        """Every plan, oldest first."""
        found = []
        for path in sorted((self.folder / "plans").glob("*.json")):
            with _reading(path):
                content = _read_json(path)
                jobs = tuple(_job(job) for job in content["jobs"])
                missing, baseline = tuple(content["missing"]), content.get("baseline", "")
                found.append(Plan(content["suite"], jobs, missing, content["command"], baseline))
        return found

    def jobs(self) -> list[Job]:
        """The newest job of every cell that was ever planned, in the order of planning."""
        newest: dict[tuple[str, str, str, str, int], Job] = {}
        for plan in self.plans():
            newest |= {job.cell: job for job in plan.jobs}
        return list(newest.values())

    def add_instance(self, key: str, instance: Instance) -> None:
        """Keep an instance: the problem apart from the truth, which no method is given."""
        final = self.folder / "instances" / key
        if final.exists():
            return
        with self.work_folder() as work:
            save_problem(work / "problem.npz", instance.problem)
            hidden: dict[str, Any] = {"truth": instance.truth, "outliers": instance.outliers}
            with (work / "truth.npz").open("wb") as file:
                np.savez(file, **{name: value for name, value in hidden.items() if value is not None})
            facts = {f: getattr(instance, f) for f in ("name", "protocol", "source", "revision", "notes")}
            facts["statistics"] = dict(instance.statistics)
            _write_json(work / "instance.json", facts)
            final.parent.mkdir(parents=True, exist_ok=True)
            try:
                work.rename(final)
            except OSError:
                if not final.exists():
                    raise

    def problem_path(self, key: str) -> Path:
        """File of an instance's problem."""
        return self.folder / "instances" / key / "problem.npz"

    def instance(self, key: str) -> Instance:
        """Read an instance back."""
        folder = self.folder / "instances" / key
        with _reading(folder):
            problem = load_problem(folder / "problem.npz")
            hidden = npz.load(folder / "truth.npz", ("truth", "outliers"))
            if {"truth": (problem.n, 3, 3), "outliers": (problem.m,)} | {k: v.shape for k, v in hidden.items()} != {
                "truth": (problem.n, 3, 3),
                "outliers": (problem.m,),
            }:
                raise ValueError("truth.npz does not fit problem.npz")
            facts = _read_json(folder / "instance.json")
            facts["notes"] = tuple(facts["notes"])
            return Instance(problem, hidden.get("truth"), outliers=hidden.get("outliers"), **facts)

    def record(self, job_id: str) -> dict[str, Any] | None:
        """Record of a job, or None where there is none that can be read."""
        try:
            return _read_json(self._record_path(job_id))
        except (FileNotFoundError, InputError):
            return None

    def add_record(self, job_id: str, record: Mapping[str, Any], estimate: Path | None) -> None:
        """Keep the record of a job and, before it, the file of its estimate."""
        if estimate is not None:
            final = self._estimate_path(job_id)
            final.parent.mkdir(parents=True, exist_ok=True)
            estimate.replace(final)
        _write_json(self._record_path(job_id), {**record, "schema": SCHEMA})

    def estimate(self, job_id: str) -> Estimate:
        """Estimate of a job whose outcome is ``ok``."""
        return load_estimate(self._estimate_path(job_id), self.record(job_id) or {})

    @contextmanager
    def work_folder(self) -> Iterator[Path]:
        """A folder for a job in progress, on the same file system; removed afterwards."""
        parent = self.folder / "work"
        parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(dir=parent))
        try:
            yield work
        finally:
            shutil.rmtree(work, ignore_errors=True)

    def _record_path(self, job_id: str) -> Path:
        return self.folder / "records" / f"{job_id}.json"

    def _estimate_path(self, job_id: str) -> Path:
        return self.folder / "estimates" / f"{job_id}.npz"


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f"{path.name}.{os.getpid()}.part")
    temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")
    temporary.replace(path)


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # a damaged file may fail in any of a dozen ways
        why = shown(f"{type(error).__name__}: {error}", 200)
        raise InputError(f"{path} cannot be read ({why}); delete it and run again") from error


def _job(content: Mapping[str, Any]) -> Job:
    job = Job(**content)
    texts = (job.id, job.dataset, job.instance, job.instance_key, job.method, job.title, job.origin)
    if not all(isinstance(text, str) for text in texts) or not isinstance(job.parameters, dict):
        raise TypeError("a job is described by text and parameters")
    if not (job.id.isalnum() and job.instance_key.isalnum() and isinstance(job.seed, int)):
        raise ValueError("a key has characters other than letters and digits")
    return job


def _read_json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} cannot be read ({error}); delete it and run again") from error
    if not isinstance(content, dict):
        raise InputError(f"{path} does not hold a record; delete it and run again")
    return content
