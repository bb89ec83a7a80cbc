"""The engine of timing runs: one job at a time, on one core, in rounds in which every method has its turn."""

import contextlib
import itertools
import os
import threading
from collections.abc import Generator, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median

from bench.core.limits import Limits
from bench.execution.execute import Ended, execute
from bench.execution.launch import Launcher
from bench.execution.output import ESTIMATE_FILE
from bench.running.engines.local import Finished, not_installed, request_of
from bench.storage.record import Record
from bench.storage.store import Store
from bench.suite.experiment import Cell

REPEAT_S = 0.3  # a round of a fast method solves as often as fits into this


class TimingEngine:
    """Times cells: on each instance every method once, then all again, so that a drift of the machine hits all alike.

    A round is a supervised child that is pinned to one core, the last one that this process may use. The child
    loads the problem, imports, compiles and warms up before the clock starts; where solving takes less than a few
    seconds, one solution is part of the warm-up, and the round counts for the median of those that follow. Every
    second round goes through the methods backwards.

    What is stored of a job: as ``round_s`` the solve seconds of its rounds, their median as ``solve_s``, and as
    ``waited`` the largest share of a round's time in which another process had the core; all else, the estimate
    too, is that of the first round. A job whose round does not end well ends so, and
    takes no part in the rounds that follow.

    Parameters
    ----------
    store, limits
        As of `LocalEngine`; the limits are those of one round.
    """

    def __init__(self, store: Store, limits: Limits) -> None:
        self.store = store
        self.limits = limits
        self.core = max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
        self.launcher = Launcher(limits.threads)
        self.stop = threading.Event()

    def run(self, cells: Iterable[Cell]) -> Generator[Finished, None, None]:
        """Yield each cell with its record as soon as its last round is over and it is stored.

        When the caller stops iterating, what was timed of the jobs in progress is lost.
        """
        try:
            for _, group in itertools.groupby(cells, key=lambda cell: cell.job.instance_key):
                yield from self._run_instance(list(group))
        finally:
            self.launcher.close()

    def _run_instance(self, cells: Sequence[Cell]) -> Generator[Finished, None, None]:
        with contextlib.ExitStack() as stack:
            timed = []
            for cell in cells:
                if cell.method.not_installed(cell.job.parameters):
                    yield cell, not_installed(cell.job, cell.method, self.store, self.limits)
                else:
                    timed.append(_Timed(cell, stack.enter_context(self.store.work_folder())))
            for number in range(max((cell.job.rounds for cell in cells), default=0)):
                for job in timed[:: -1 if number % 2 else 1]:
                    if not job.over:
                        self._run_round(job)
                        if job.over:
                            yield job.cell, self._stored(job)

    def _run_round(self, job: "_Timed") -> None:
        folder = job.folder / str(len(job.round_s))
        folder.mkdir()
        request = request_of(job.cell.job, self.store, folder, self.limits.threads)
        request = replace(request, core=self.core, repeat_s=REPEAT_S)
        ended = execute(request, job.requires, self.launcher, self.limits, self.stop)
        if ended.outcome.ok:
            job.round_s.append(median(ended.report.solves_s))
            job.waited = max(job.waited, ended.report.waited or 0.0)
        if job.ended is None or not ended.outcome.ok:
            job.ended = ended

    def _stored(self, job: "_Timed") -> Record:
        assert job.ended is not None
        record = job.ended.record(job.cell.job, job.requires, self.limits)
        ok = record.outcome.ok
        if ok:
            report = replace(record.report, solve_s=median(job.round_s), solves_s=(), waited=job.waited)
            record = replace(record, report=report, round_s=tuple(job.round_s))
        self.store.add_record(record, job.folder / "0" / ESTIMATE_FILE if ok else None)
        return record


class _Timed:
    """A cell with what its rounds have told so far."""

    def __init__(self, cell: Cell, folder: Path) -> None:
        self.cell = cell
        self.folder = folder
        self.requires = cell.method.requires_of(cell.job.parameters)
        self.ended: Ended | None = None  # the first round, or the one that did not end well
        self.round_s: list[float] = []
        self.waited = 0.0

    @property
    def over(self) -> bool:
        """Whether there is nothing more to run."""
        failed = self.ended is not None and not self.ended.outcome.ok
        return failed or len(self.round_s) == self.cell.job.rounds
