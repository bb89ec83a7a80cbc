"""The local engine: threads that each supervise one child at a time."""

import threading
from collections.abc import Generator, Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bench.core import outcome
from bench.core.outcome import Outcome
from bench.execution.child import Request
from bench.execution.job import execute, record_of
from bench.execution.launch import Launcher
from bench.execution.output import ESTIMATE_FILE
from bench.execution.supervise import Interrupted, Limits
from bench.plugins.declare import Info
from bench.running.engines.folders import WorkFolders
from bench.storage.store import Store
from bench.suite.experiment import Cell
from bench.suite.plan import Job

Finished = tuple[Cell, dict[str, Any]]


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
    threads
        How many threads the numerical libraries of each child may use.
    """

    def __init__(self, store: Store, limits: Limits, workers: int, threads: int) -> None:
        self.store = store
        self.limits = limits
        self.workers = workers
        self.threads = threads
        self.launcher = Launcher(threads)
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
        return cell, run_job(cell.job, cell.method, self.folders, self.launcher, self.limits, self.threads, self.stop)


def run_job(
    job: Job,
    method: Info,
    folders: WorkFolders,
    launcher: Launcher,
    limits: Limits,
    threads: int,
    stop: threading.Event,
    told: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
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
    if method.not_installed:
        return not_installed(job, method, store, limits, threads)
    with folders.empty() as work:
        request = request_of(job, store, work, threads)
        ended, report = execute(request, method.requires, launcher, limits, stop)
        record = record_of(asdict(job), method.requires, limits, threads, ended, report)
        record["provenance"] = record["provenance"] | (told or {})
        store.add_record(job.id, record, work / ESTIMATE_FILE if ended.kind == outcome.OK else None)
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
    )


def not_installed(job: Job, method: Info, store: Store, limits: Limits, threads: int) -> dict[str, Any]:
    """Keep a record, which is returned, that says what a method lacks, and how to get it."""
    hint = Outcome(outcome.NOT_INSTALLED, method.install_hint)
    record = record_of(asdict(job), (), limits, threads, hint, {})
    store.add_record(job.id, record, None)
    return record
