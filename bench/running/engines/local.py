"""The local engine: threads that each supervise one child at a time."""

import threading
from collections.abc import Generator, Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from pathlib import Path

from bench.core import outcome
from bench.core.limits import Limits
from bench.core.outcome import Outcome
from bench.execution.child import Request
from bench.execution.execute import Ended, execute
from bench.execution.launch import Launcher
from bench.execution.output import ESTIMATE_FILE
from bench.execution.supervise import Interrupted
from bench.plugins.declare import MethodInfo
from bench.running.engines.folders import WorkFolders
from bench.storage.record import Record
from bench.storage.store import Store
from bench.suite.experiment import Cell
from bench.suite.plan import Job

Finished = tuple[Cell, Record]


class LocalEngine:
    """Runs cells on this machine, `workers` at a time.

    Parameters
    ----------
    store
        Where instances are and records go.
    limits
        Of one job.
    workers
        How many children at a time.
    """

    def __init__(self, store: Store, limits: Limits, workers: int) -> None:
        self.store = store
        self.limits = limits
        self.workers = workers
        self.launcher = Launcher(limits.threads)
        self.stop = threading.Event()
        self.folders = WorkFolders(store)

    def run(self, cells: Iterable[Cell]) -> Generator[Finished, None, None]:
        """Yield each cell with its record as soon as it is stored.

        When the caller stops iterating, jobs in progress are ended without a record.
        """
        waiting: set[Future[Finished]] = set()
        pool = ThreadPoolExecutor(self.workers)
        try:
            for cell in cells:
                waiting.add(pool.submit(self._run_one, cell))
                if len(waiting) >= 2 * self.workers:
                    done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                    yield from (future.result() for future in done)
            while waiting:
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in done)
        finally:
            self.stop.set()
            pool.shutdown(cancel_futures=True)
            self.launcher.close()
            self.folders.close()

    def _run_one(self, cell: Cell) -> Finished:
        if self.stop.is_set():
            raise Interrupted
        return cell, run_job(cell.job, cell.method, self.folders, self.launcher, self.limits, self.stop)


def run_job(
    job: Job,
    method: MethodInfo,
    folders: WorkFolders,
    launcher: Launcher,
    limits: Limits,
    stop: threading.Event,
    told: Mapping[str, str] | None = None,
) -> Record:
    """Run one job in a supervised child and keep its record, which is returned; what every engine does.

    Parameters
    ----------
    told
        Facts of the record's provenance that this process cannot know.

    Raises
    ------
    Interrupted
        Once `stop` is set; no record is kept then.
    """
    store = folders.store
    if method.not_installed(job.parameters):
        return not_installed(job, method, store, limits)
    with folders.empty() as work:
        requires = method.requires_of(job.parameters)
        ended = execute(request_of(job, store, work, limits.threads), requires, launcher, limits, stop)
        record = ended.record(job, requires, limits)
        record = replace(record, provenance={**record.provenance, **(told or {})})
        store.add_record(record, work / ESTIMATE_FILE if ended.outcome.ok else None)
    return record


def request_of(job: Job, store: Store, folder: Path, threads: int) -> Request:
    """What the child of a job is told; its results go to `folder`."""
    return Request(
        problem=str(store.problem_path(job.instance_key).resolve()),
        origin=job.origin,
        method=job.method,
        parameters=dict(job.parameters),
        seed=job.seed,
        threads=threads,
        folder=str(folder.resolve()),
        use=job.use,
    )


def not_installed(job: Job, method: MethodInfo, store: Store, limits: Limits) -> Record:
    """Keep a record, which is returned, that says what a method lacks, and how to get it."""
    ended = Ended(Outcome(outcome.NOT_INSTALLED, method.install_hint(job.parameters)))
    record = ended.record(job, (), limits)
    store.add_record(record, None)
    return record
