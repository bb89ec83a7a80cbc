"""The dask engine: the same supervised jobs, on the workers of a dask cluster.

What is sent to a worker is a chunk of jobs, which are plain values. The worker supervises their children one
after another, as the local engine does, and writes the records into the run's folder itself, which it must see
under the same path. The client holds a bounded number of chunks in flight, however many jobs there are.
"""

import asyncio
import contextlib
import logging
import math
import signal
import threading
import time
import uuid
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from typing import TypeAlias

from distributed import (
    Client,
    Future,
    KilledWorker,
    LocalCluster,
    Reschedule,
    Worker,
    WorkerPlugin,
    as_completed,
    get_worker,
)

from bench.core import outcome
from bench.core.errors import InputError
from bench.core.limits import Limits
from bench.core.outcome import Outcome
from bench.execution import provenance
from bench.execution.execute import Ended
from bench.execution.launch import Launcher
from bench.execution.supervise import Interrupted
from bench.plugins.catalog import method_at
from bench.plugins.declare import MethodInfo
from bench.running.engines.folders import WorkFolders
from bench.running.engines.local import Finished, run_job
from bench.storage.record import Record
from bench.storage.store import Store
from bench.suite.experiment import Cell
from bench.suite.plan import Job

CHUNK_S = 2.0  # a chunk that has taken longer gives back the jobs that it has not begun
LONGEST = 256  # jobs of a chunk
AHEAD = 2  # chunks in flight for each thread of a worker
CONNECT_S = 10.0
POLL_S = 0.05
KEEP_S = 2.0

Chunk: TypeAlias = "Future[list[Record]]"


class DaskEngine:
    """Runs cells on the workers of a dask cluster, one job at a time on each of their threads.

    Parameters
    ----------
    store
        Where instances are and records go; every worker must see it under the same path.
    limits
        Of one job.
    workers
        Worker processes of a cluster of its own, one thread each; with a scheduler, how many threads to keep
        supplied before that many have joined.
    scheduler
        Address of a running scheduler, such as ``tcp://host:8786``; None for a cluster of its own on this machine.
    """

    def __init__(self, store: Store, limits: Limits, workers: int, scheduler: str | None = None) -> None:
        self.store = Store(store.folder.resolve())
        self.limits = limits
        self.workers = workers
        self.scheduler = scheduler

    def run(self, cells: Iterable[Cell]) -> Generator[Finished, None, None]:
        """Yield each cell with its record some time after a worker has stored it.

        When the caller stops iterating, jobs in progress are ended without a record.

        Raises
        ------
        InputError
            Where no scheduler answers, or a worker lacks the run's folder or has another source of a method.
        """
        waiting = deque(cells)
        if not waiting:
            return
        told = {"command": provenance.of_this_run()["command"], "run": uuid.uuid4().hex}
        supervisor = Supervisor(self.store, self.limits, told, own=self.scheduler is None)
        with self._client(len(waiting)) as client:
            client.register_plugin(supervisor)
            dispatch = _Dispatch(client, supervisor, self.workers, waiting)
            try:
                yield from dispatch.finished()
            finally:
                with contextlib.suppress(OSError):  # the scheduler may have gone first
                    client.cancel(list(dispatch.running))
                    client.unregister_worker_plugin(supervisor.name)

    @contextlib.contextmanager
    def _client(self, jobs: int) -> Iterator[Client]:
        with contextlib.ExitStack() as stack:
            address = self.scheduler or stack.enter_context(_own_cluster(min(self.workers, jobs)))
            try:
                client = Client(address, timeout=CONNECT_S, set_as_default=False)
            except (OSError, ValueError) as error:
                raise InputError(f"--scheduler {self.scheduler}: no dask scheduler answers there ({error})") from error
            yield stack.enter_context(client)


@contextlib.contextmanager
def _own_cluster(workers: int) -> Iterator[LocalCluster]:
    """A cluster on this machine, which keeps its number of workers."""
    over = threading.Event()

    def keep(cluster: LocalCluster) -> None:
        # A nanny restarts its worker, but the cluster gives up a worker whose restart happens to coincide with a
        # check; asking for the same number again makes another.
        while not over.wait(KEEP_S):
            cluster.scale(workers)

    try:
        started = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=0,
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
        )
    except RuntimeError as error:
        hint = "in a script, bench.run must stand below: if __name__ == '__main__':"
        raise InputError(f"the dask cluster on this machine did not start ({error}); {hint}") from error
    with started as cluster:
        keeper = threading.Thread(target=keep, args=(cluster,), daemon=True)
        keeper.start()
        try:
            yield cluster
        finally:
            over.set()
            keeper.join()


class Supervisor(WorkerPlugin):
    """What a worker process keeps for one run: the launcher of its children, until the run or the worker ends."""

    def __init__(self, store: Store, limits: Limits, told: dict[str, str], *, own: bool) -> None:
        self.store = store
        self.limits = limits
        self.told = told
        self.own = own
        self.name = f"rotsync-{told['run']}"

    def setup(self, worker: Worker) -> None:
        """On the worker: get ready."""
        if self.own:
            # Ctrl-C in a terminal reaches all; the client ends its workers
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        self.launcher = Launcher(self.limits.threads)
        self.folders = WorkFolders(self.store)
        self.stop = threading.Event()
        self.lock = threading.Lock()
        self.busy = 0

    async def teardown(self, worker: Worker) -> None:
        """On the worker: end the children in progress without a record, then their servers."""
        self.stop.set()
        while self.busy:
            await asyncio.sleep(POLL_S)
        self.launcher.close()
        self.folders.close()

    def run(self, jobs: Sequence[Job]) -> list[Record]:
        """On the worker: run jobs in their order until the time is used up; the records of those that were run."""
        with self.lock:
            self.busy += 1
        try:
            until = time.monotonic() + CHUNK_S
            records: list[Record] = []
            while len(records) < len(jobs) and (not records or time.monotonic() < until):
                job = jobs[len(records)]
                records.append(self.record(job) or self._run_one(job))
            return records
        except Interrupted:
            raise Reschedule from None  # where the worker was retired, and not the run stopped, another goes on
        finally:
            with self.lock:
                self.busy -= 1

    def record(self, job: Job) -> Record | None:
        """What this run has stored of a job already, before a worker died."""
        try:
            record = self.store.record(job.id)
        except InputError:
            return None
        return record if record is not None and record.provenance.get("run") == self.told["run"] else None

    def _run_one(self, job: Job) -> Record:
        if self.stop.is_set():
            raise Interrupted
        if not self.store.problem_path(job.instance_key).exists():
            raise InputError(f"the dask worker on {_host()} does not see the folder of the run, {self.store.folder}")
        method = _same_method(job)
        return run_job(job, method, self.folders, self.launcher, self.limits, self.stop, self.told)


def run_chunk(supervisor: str, jobs: Sequence[Job]) -> list[Record]:
    """Run jobs on the worker that executes this; see `Supervisor.run`."""
    plugin = get_worker().plugins[supervisor]
    assert isinstance(plugin, Supervisor)
    return plugin.run(jobs)


_importing = threading.Lock()


def _same_method(job: Job) -> MethodInfo:
    """The method of a job as this worker finds it, which must be the one that was planned."""
    try:
        with _importing:  # a worker may have several threads, and a module is there before all of it is
            method = method_at(job.origin, job.method)
    except Exception as error:  # a plug-in may fail in any way
        raise InputError(f"the dask worker on {_host()} cannot import {job.origin}: {error}") from error
    if method is None or method.version_of(job.parameters) != job.source_hash:
        raise InputError(
            f"the dask worker on {_host()} has another version of '{job.method}' in {job.origin}; "
            "install the same one there, and start the workers again"
        )
    return method


def _host() -> str:
    return provenance.of_this_run()["host"]


class _Dispatch:
    """The client's side of a run: which chunks are in flight, and what becomes of those that fail."""

    def __init__(self, client: Client, supervisor: Supervisor, workers: int, waiting: deque[Cell]) -> None:
        self.client = client
        self.supervisor = supervisor
        self.workers = workers
        self.waiting = waiting
        self.suspects: deque[Cell] = deque()  # workers have died under their chunk: each gets a chunk of its own
        self.accused: deque[Cell] = deque()  # and under that one: each gets the cluster for itself, at the end
        self.on_trial = False
        self.running: dict[Chunk, list[Cell]] = {}
        self.completed = as_completed(loop=client.loop)
        self.submitted = 0
        self.jobs = 0
        self.seconds = 0.0

    def finished(self) -> Iterator[Finished]:
        """Submit chunks and yield cells until there are none left."""
        self._submit()
        for future in self.completed:
            yield from self._collected(future)
            self._submit()

    def _submit(self) -> None:
        slots = max(sum(self.client.nthreads().values()), self.workers)
        while len(self.running) < AHEAD * slots and (self.suspects or self.waiting):
            if self.suspects:
                self._start([self.suspects.popleft()])
            else:
                self._start([self.waiting.popleft() for _ in range(self._size(slots))])
        if not self.running and self.accused:
            self.on_trial = True
            self._start([self.accused.popleft()])

    def _start(self, cells: list[Cell]) -> None:
        self.submitted += 1
        key = f"{self.supervisor.name}-{self.submitted}"
        future = self.client.submit(run_chunk, self.supervisor.name, [cell.job for cell in cells], key=key)
        self.running[future] = cells
        self.completed.add(future)

    def _size(self, slots: int) -> int:
        """As many jobs as fit into a chunk's time, judged by those before, but so few that all workers get some."""
        fitting = int(CHUNK_S * self.jobs / self.seconds) if self.seconds else 1
        share = math.ceil(len(self.waiting) / (2 * AHEAD * slots))
        return max(1, min(fitting, share, LONGEST))

    def _collected(self, future: Chunk) -> Iterator[Finished]:
        cells = self.running.pop(future)
        try:
            records = future.result()
        except KilledWorker as error:
            yield from self._after_deaths(cells, error.allowed_failures + 1)
        except CancelledError:
            raise InputError(
                "the dask scheduler has gone; what is done is kept, and the same command continues"
            ) from None
        else:
            self.waiting.extendleft(reversed(cells[len(records) :]))
            self.jobs += len(records)
            self.seconds += sum(record.wall_s or 0.0 for record in records)
            yield from zip(cells, records, strict=False)

    def _after_deaths(self, cells: list[Cell], deaths: int) -> Iterator[Finished]:
        """Keep what was done. A job is the cause only where nothing else was running, on any thread of any worker."""
        for cell in cells:
            record = self.supervisor.record(cell.job)
            if record is not None:
                yield cell, record
            elif self.on_trial:
                yield cell, self._crashed(cell, deaths)
            else:
                (self.suspects if len(cells) > 1 else self.accused).append(cell)

    def _crashed(self, cell: Cell, deaths: int) -> Record:
        ended = Ended(Outcome(outcome.CRASHED, f"{deaths} dask workers died while running it"))
        record = ended.record(cell.job, cell.method.requires_of(cell.job.parameters), self.supervisor.limits)
        self.supervisor.store.add_record(record, None)
        return record
