"""The local engine: threads that each supervise one child at a time."""

import threading
from collections.abc import Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bench.execution import outcome
from bench.execution.child import Request
from bench.execution.job import execute, record_of
from bench.execution.launch import Launcher
from bench.execution.outcome import Outcome
from bench.execution.report import ESTIMATE_FILE
from bench.execution.supervise import Interrupted, Limits
from bench.experiment import Cell
from bench.store import Store

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

    def _run_one(self, cell: Cell) -> Finished:
        job = cell.job
        if self.stop.is_set():
            raise Interrupted
        if cell.method.not_installed:
            return not_installed(cell, self.store, self.limits)
        requires = cell.method.requires
        with self.store.work_folder() as work:
            request = request_of(cell, self.store, work, self.threads)
            ended, report = execute(request, requires, self.launcher, self.limits, self.stop)
            record = record_of(asdict(job), requires, self.limits, ended, report)
            self.store.add_record(job.id, record, work / ESTIMATE_FILE if ended.kind == outcome.OK else None)
        return cell, record


def request_of(cell: Cell, store: Store, folder: Path, threads: int) -> Request:
    """What the child of a cell is told; its results go to `folder`."""
    job = cell.job
    return Request(
        problem=str(store.problem_path(job.instance_key).resolve()),
        origin=job.origin,
        method=job.method,
        parameters=dict(job.parameters),
        seed=job.seed,
        threads=threads,
        folder=str(folder.resolve()),
    )


def not_installed(cell: Cell, store: Store, limits: Limits) -> Finished:
    """Keep a record that says what a method lacks, and how to get it."""
    hint = Outcome(outcome.NOT_INSTALLED, cell.method.install_hint)
    record = record_of(asdict(cell.job), (), limits, hint, {})
    store.add_record(cell.job.id, record, None)
    return cell, record
