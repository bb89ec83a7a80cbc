"""What a run leaves on disk: plans, instances, records and estimates.

    RUN/schema.json                    version of this layout
    RUN/plans/<time>-<hash>.json       which jobs were asked for, by one call of `run`
    RUN/instances/<key>/               problem.npz, truth.npz, instance.json
    RUN/records/<id[:2]>/<id>.json     one job each, written last and by rename: it is there whole or not at all
    RUN/estimates/<id[:2]>/<id>.npz    the arrays that the method returned, float64, unrounded
    RUN/scores/                        what scoring has computed from these; may be deleted at any time
    RUN/work/                          what jobs in progress write

No file is shared between jobs, so there is no lock: any number of processes, on any number of machines, may write
into one folder. A job's id is a hash of everything that determines its result; where several plans name the same
cell of the experiment, the newest plan's job is the one that counts.
"""

import contextlib
import json
import os
import shutil
import socket
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from bench.core import typed
from bench.core.digest import digest
from bench.core.errors import InputError, described, shown
from bench.core.problem import Estimate, Instance
from bench.core.program import program
from bench.formats import archive
from bench.storage.arrays import load_estimate, load_problem, save_problem
from bench.storage.record import SCHEMA, Record, Report
from bench.suite.plan import Job, Plan, decode, encode, newest

VERSION = "schema.json"
ASIDE = "damaged"  # where what cannot be read is moved
_HIDDEN = ("truth", "outliers", "ids", "coherent")  # of an instance: in a file that no method is given
AGAIN = "run the same command again"


@dataclass(frozen=True)
class _Facts:
    """What is kept of an instance besides its arrays; see `bench.core.problem.Instance`."""

    name: str
    protocol: str
    source: str
    revision: str
    notes: tuple[str, ...]
    statistics: Mapping[str, float]
    collection: str = ""


@dataclass(frozen=True)
class Store:
    """The folder of a run.

    Every writing method raises `InputError` where the system refuses to write (a full disk, a read-only folder);
    what is there already stays as it is.
    """

    folder: Path
    _made: set[Path] = field(default_factory=set, repr=False, compare=False)

    @classmethod
    def open(cls, folder: Path) -> "Store":
        """Open a run that exists.

        Raises
        ------
        InputError
            Where the folder holds no run, or one of another version.
        """
        if not (folder / "plans").is_dir():
            raise InputError(f"{folder} is not the folder of a run; make one with: {program()} run --out {folder}")
        _check_version(folder / VERSION)
        return cls(folder)

    def add_plan(self, plan: Plan, name: str = "") -> None:
        """Keep a plan; one of another run under its name there, unless it is here already."""
        self.mark()
        content = encode(plan)
        if name:
            if not (self.folder / "plans" / name).exists():
                self._write_json(self.folder / "plans" / name, content, indent=None)
            return
        moment = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")
        self._write_json(self.folder / "plans" / f"{moment}-{digest(content)[:8]}.json", content, indent=None)

    def mark(self) -> None:
        """Write the version of the layout, before the first plan."""
        if not (self.folder / VERSION).exists():
            self._write_json(self.folder / VERSION, {"schema": SCHEMA})

    def plans(self) -> list[Plan]:
        """Every plan, oldest first.

        Raises
        ------
        InputError
            On the first that cannot be read.
        """
        return [self.plan(path) for path in sorted((self.folder / "plans").glob("*.json"))]

    def plan(self, path: Path) -> Plan:
        """Read one plan; raises `InputError` where that fails."""
        with _reading(path, f"see: {program()} doctor {self.folder} --repair"):
            return decode(read_json(path), "the plan")

    def jobs(self) -> list[Job]:
        """The newest job of every cell that was ever planned, in the order of planning."""
        return newest(self.plans())

    def add_instance(self, key: str, instance: Instance) -> None:
        """Keep an instance: the problem apart from the truth, which no method is given."""
        final = self.folder / "instances" / key
        if final.exists():
            return
        with self.work_folder() as work, _writing(final):
            save_problem(work / "problem.npz", instance.problem)
            hidden: dict[str, Any] = {name: getattr(instance, name) for name in _HIDDEN}
            with (work / "truth.npz").open("wb") as file:
                np.savez(file, **{name: value for name, value in hidden.items() if value is not None})
            facts = {f.name: getattr(instance, f.name) for f in fields(_Facts)}
            self._write_json(work / "instance.json", facts | {"statistics": dict(instance.statistics)})
            final.parent.mkdir(parents=True, exist_ok=True)
            try:
                work.rename(final)
            except OSError:
                if not final.exists():
                    raise

    def has_instance(self, key: str) -> bool:
        """Whether an instance is there; one that cannot be read is put aside, as if it were not."""
        folder = self.folder / "instances" / key
        if not folder.exists():
            return False
        try:
            self.instance(key)
        except InputError:
            with _writing(self.folder / ASIDE):
                self._make(self.folder / ASIDE)
                folder.rename(tempfile.mkdtemp(prefix=f"{key}-", dir=self.folder / ASIDE))
            return False
        return True

    def problem_path(self, key: str) -> Path:
        """File of an instance's problem."""
        return self.folder / "instances" / key / "problem.npz"

    def instance(self, key: str) -> Instance:
        """Read an instance back; raises `InputError` where that fails."""
        folder = self.folder / "instances" / key
        with _reading(folder, f"run the same command again, or see: {program()} doctor {self.folder} --repair"):
            problem = load_problem(folder / "problem.npz")
            hidden = archive.load(folder / "truth.npz", _HIDDEN)
            shapes = {
                "truth": (problem.n, 3, 3),
                "outliers": (problem.m,),
                "ids": (problem.n,),
                "coherent": (problem.m,),
            }
            if any(values.shape != shapes[name] for name, values in hidden.items()):
                raise ValueError("truth.npz does not fit problem.npz")
            facts = typed.read(_Facts, read_json(folder / "instance.json"), "instance.json")
            known: dict[str, Any] = {name: hidden.get(name) for name in _HIDDEN}
            return Instance(problem, **known, **vars(facts))

    def record(self, job_id: str) -> Record | None:
        """Record of a job, or None where there is none.

        Raises
        ------
        InputError
            Where there is one that cannot be read.
        """
        path = self.record_path(job_id)
        with _reading(path, AGAIN):
            try:
                record = Record.from_json(read_json(path), "the record")
            except FileNotFoundError:
                return None
            if record.job.id != job_id:
                raise ValueError("it is the record of another job")
            return record

    def add_record(self, record: Record, estimate: Path | None) -> None:
        """Keep the record of a job and, before it, the file of its estimate."""
        if estimate is not None:
            final = self.estimate_path(record.job.id)
            with _writing(final):
                self._make(final.parent)
                estimate.replace(final)
        self._write_json(self.record_path(record.job.id), record.to_json(), indent=None)

    def estimate(self, job_id: str, record: Record | None = None) -> Estimate:
        """Estimate of a job whose outcome is ``ok``; raises `InputError` where it cannot be read."""
        path = self.estimate_path(job_id)
        record = record or self.record(job_id)
        with _reading(path, AGAIN):
            return load_estimate(path, record.report if record else Report())

    @contextmanager
    def work_folder(self) -> Iterator[Path]:
        """A folder for a job in progress, on the same file system; removed afterwards."""
        parent = self.folder / "work"
        with _writing(parent):
            self._make(parent)
            work = Path(tempfile.mkdtemp(prefix=f"{socket.gethostname()}.{os.getpid()}.", dir=parent))
        try:
            yield work
        finally:
            shutil.rmtree(work, ignore_errors=True)

    def abandoned(self) -> list[Path]:
        """Folders in ``work`` whose process, on this machine, is gone."""
        import psutil

        found = []
        for path in (self.folder / "work").glob(f"{socket.gethostname()}.*.*"):
            pid = path.name.rsplit(".", 2)[1]
            if pid.isdecimal() and not psutil.pid_exists(int(pid)):
                found.append(path)
        return found

    def sweep(self) -> None:
        """Remove what processes that are gone have left in ``work``."""
        for path in self.abandoned():
            shutil.rmtree(path, ignore_errors=True)

    def copy_in(self, source: Path, final: Path) -> None:
        """Copy a file of another run to its place in this one, by rename and with its times."""
        with _writing(final), self.work_folder() as work:
            shutil.copy2(source, work / final.name)
            self._make(final.parent)
            (work / final.name).replace(final)

    def record_path(self, job_id: str) -> Path:
        """File of a job's record."""
        return self.folder / "records" / job_id[:2] / f"{job_id}.json"

    def estimate_path(self, job_id: str) -> Path:
        """File of a job's estimate."""
        return self.folder / "estimates" / job_id[:2] / f"{job_id}.npz"

    def _make(self, folder: Path) -> None:
        if folder not in self._made:
            folder.mkdir(parents=True, exist_ok=True)
            self._made.add(folder)

    def _write_json(self, path: Path, content: Mapping[str, Any], indent: int | None = 1) -> None:
        with _writing(path):
            self._make(path.parent)
            write_json(path, content, indent)


def write_json(path: Path, content: Mapping[str, Any], indent: int | None = 1) -> None:
    """Write a file by rename, so that a reader finds it whole or not at all."""
    temporary = path.with_name(f"{path.name}.{socket.gethostname()}.{os.getpid()}.part")
    try:
        temporary.write_text(json.dumps(content, indent=indent), encoding="utf-8")
        temporary.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{path} cannot be written ({_why(error)}); what is finished is kept, and the same command continues"
        ) from error


@contextmanager
def _reading(path: Path, remedy: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:  # a damaged file may fail in any of a dozen ways
        raise InputError(f"{path} cannot be read ({_why(error)}); {remedy}") from error


def read_json(path: Path) -> dict[str, Any]:
    """Content of a file that holds a JSON object; raises `OSError` or `ValueError` where there is none."""
    content = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(content, dict):
        raise ValueError("not a JSON object")
    return content


def _check_version(path: Path) -> None:
    """Refuse what another version wrote, which differs in ways that no reader here knows."""
    try:
        found = read_json(path).get("schema")
    except (OSError, ValueError):
        found = None
    if found != SCHEMA:
        raise InputError(
            f"{path.parent} was written by another version of bench (layout {found}, and this one has {SCHEMA}); "
            "give this run another folder with --out"
        )


def _why(error: BaseException) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return shown(str(error), 200).strip("'\"") if isinstance(error, InputError) else described(error, 200)
