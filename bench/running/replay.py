"""Repeat one job from its record alone, and say what is no longer as it was."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench.core import so3
from bench.core.errors import InputError
from bench.core.outcome import Outcome
from bench.core.problem import Estimate, Floats, Problem
from bench.core.words import counted
from bench.execution import child, provenance
from bench.execution.execute import Ended
from bench.execution.single import Answer, SingleSolver, answer, request_in
from bench.plugins.catalog import catalog
from bench.plugins.declare import MethodInfo, Missing, Source
from bench.plugins.sources import sources_of
from bench.storage.record import Record
from bench.storage.store import Store, read_json
from bench.suite.experiment import instance_key
from bench.suite.plan import Job


@dataclass(frozen=True)
class Repetition:
    """A job that is ready to be run again.

    Parameters
    ----------
    record
        What was run, and all that is known of it.
    method, problem
        What will be run, on what.
    stored
        The estimate of then, where the record lies in the folder of its run.
    differences
        A sentence for everything that is no longer as it was.
    """

    record: Record
    method: MethodInfo
    problem: Problem
    stored: Estimate | None
    differences: tuple[str, ...]

    def supervised(self) -> Answer:
        """Run it in a child process, within the limits of the record."""
        job = self.record.job
        with SingleSolver(self.method, job.parameters, self.record.limits, job.use) as solver:
            return solver.solve(self.problem, job.seed)

    def in_this_process(self) -> Answer:
        """Run it here, without limits; whatever the method raises comes through."""
        job, threads = self.record.job, self.record.limits.threads
        with tempfile.TemporaryDirectory(prefix="rotsync-") as name:
            folder = Path(name)
            request = request_in(folder, self.method, job.parameters, self.problem, job.seed, threads)
            request = replace(request, use=job.use)
            result = child.solve(request, child.prepare(request))
            return answer(Ended(result.outcome, result.report), folder)

    def same(self, ended: Outcome, estimate: Estimate | None) -> bool:
        """Whether it ended as it did then, with every bit of the estimate as it was where that is stored."""
        if ended.kind != self.record.outcome.kind:
            return False
        return self.stored is None or (estimate is not None and _identical(self.stored, estimate))

    def compared(self, estimate: Estimate | None) -> str:
        """How the estimate differs from the stored one, in one sentence; empty where there are no two."""
        if estimate is None or self.stored is None:
            return ""
        if _identical(self.stored, estimate):
            return "the estimate is bit-identical to the stored one"
        then, now = self.stored.rotations, estimate.rotations
        if then.shape != now.shape:
            return f"the estimate has {len(now)} cameras, and the stored one {len(then)}"
        both = np.isfinite(then).all(axis=(1, 2)) & np.isfinite(now).all(axis=(1, 2))
        others = len(now) - int(both.sum())
        gone = f"; {counted(others, 'camera is', 'cameras are')} not solved by both" if others else ""
        angle = _largest_angle_deg(now[both], then[both])
        return f"the estimate differs from the stored one by up to {angle:.3g} degrees, the gauge removed{gone}"


def prepare(path: Path, data_dir: Path | None = None, plugins: Sequence[Path] = ()) -> Repetition:
    """Make the job of a record ready.

    Parameters
    ----------
    path
        A record's JSON file; in the folder of its run, stored data stand in for those that cannot be made again.
    data_dir
        Where data are looked for first.
    plugins
        Where the record's plug-in files are now; by default where they were.

    Raises
    ------
    InputError
        Where the file is not a record, or its method or data are not to be had.
    """
    record = _read(path)
    job = record.job
    methods = catalog("method", plugins or _plugin_files(job.origin))
    method = methods[job.method]
    run = next((folder for folder in path.resolve().parents if (folder / "plans").is_dir()), None)
    store = Store.open(run) if run is not None else None
    problem, differences = _problem(job, data_dir, plugins, store)
    differences += _changes(record, method)
    stored = store.estimate(job.id, record) if store is not None and record.outcome.ok else None
    return Repetition(record, method, problem, stored, tuple(differences))


def _read(path: Path) -> Record:
    try:
        return Record.from_json(read_json(path), "the record")
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file; records are in RUN/records") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{path} is not the record of a job ({error})") from error


def _plugin_files(origin: str) -> list[Path]:
    if not origin.endswith(".py"):
        return []
    if not Path(origin).is_file():
        raise InputError(f"the plug-in {origin} is not there any more; say where it is with --plugin FILE")
    return [Path(origin)]


def _problem(
    job: Job, data_dir: Path | None, plugins: Sequence[Path], store: Store | None
) -> tuple[Problem, list[str]]:
    """The problem, made again where that gives the same instance, else the stored one, else what there is now."""
    stored = None
    if store is not None and store.problem_path(job.instance_key).exists():
        stored = store.instance(job.instance_key).problem
    try:
        now, key = _source(job, data_dir, plugins or _plugin_files(job.dataset_origin))
    except InputError as error:
        if stored is None:
            raise
        return stored, [f"{error}; the instance stored with the run is used"]
    if key == job.instance_key:
        return now.load().problem, []
    changed = f"the instance {job.dataset} {job.instance} has changed"
    if stored is not None:
        return stored, [f"{changed}; the one stored with the run is used"]
    return now.load().problem, [f"{changed}, and the one of then is not stored here; that of today is used"]


def _source(job: Job, data_dir: Path | None, plugins: Sequence[Path]) -> tuple[Source, str]:
    """The instance as it is today, and its key."""
    ((info, parameters),) = catalog("dataset", plugins).select([job.dataset])
    configured = info.configure(parameters)
    for found in sources_of(info, configured, data_dir, job.seed):
        if found.name == job.instance:
            if isinstance(found, Missing):
                raise InputError(f"{job.dataset} {job.instance} is not on disk; get it with: {found.how(info.name)}")
            return found, instance_key(info, configured, found)
    raise InputError(f"{job.dataset} has no instance '{job.instance}' any more")


def _changes(record: Record, method: MethodInfo) -> list[str]:
    """What differs besides the data."""
    sentences = []
    job = record.job
    if job.source_hash != method.version_of(job.parameters):
        sentences.append(f"the source or the weights of {job.method} have changed")
    here = provenance.of_this_run()
    then = dict(record.versions)
    now = dict(provenance.versions(method.requires_of(job.parameters)))
    for name in ("python", "bench"):
        then[name], now[name] = record.provenance.get(name, "?"), here[name]
    moved = [f"{name} {then[name]} then, {now.get(name)} now" for name in then if then[name] != now.get(name)]
    if moved:
        sentences.append(f"versions differ: {'; '.join(moved)}")
    cpu = record.provenance.get("cpu")
    if cpu != here["cpu"]:
        sentences.append(f"the processor differs: {cpu} then, {here['cpu']} now")
    return sentences


def _identical(one: Estimate, other: Estimate) -> bool:
    return one.rotations.shape == other.rotations.shape and one.rotations.tobytes() == other.rotations.tobytes()


def _largest_angle_deg(one: Floats, other: Floats) -> float:
    if not len(one):
        return float("nan")
    gauge = so3.chordal_mean(np.swapaxes(one, -1, -2) @ other)
    return float(np.degrees(so3.angle_between(one @ gauge, other).max()))
