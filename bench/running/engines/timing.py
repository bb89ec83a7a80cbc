"""The engine of timing runs: one job at a time, on one core, in rounds in which every method has its turn."""

import contextlib
import itertools
import os
import threading
from collections.abc import Generator, Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from statistics import median
from typing import Any

from bench.core import outcome
from bench.core.outcome import Outcome
from bench.execution.job import execute, record_of
from bench.execution.launch import Launcher
from bench.execution.output import ESTIMATE_FILE
from bench.execution.supervise import Limits
from bench.running.engines.local import Finished, not_installed, request_of
from bench.storage.store import Store
from bench.suite.experiment import Cell

REPEAT_S = 0.3  # a round of a fast method solves as often as fits into this


class TimingEngine:
    """Times cells: on each instance every method once, then all again, so that a drift of the machine hits all alike.

    A round is a supervised child that is pinned to one core, the last one that this process may use. The child
    loads the problem, imports, compiles and warms up before the clock starts; where solving takes less than a few
    seconds, one solution is part of the warm-up, and the round counts for the median of those that follow. Every
    second round goes through the methods backwards.

    What is stored of a job: as ``round_s`` the solve seconds of its rounds, their median as ``solve_s``, the
    smallest as ``min_s``, and as ``waited`` the largest share of a round's time in which another process had the
    core; all else, the estimate too, is that of the first round. A job whose round does not end well ends so, and
    takes no part in the rounds that follow.

    Parameters
    ----------
    store, limits, threads
        As of `LocalEngine`; the limits are those of one round.
    """

    def __init__(self, store: Store, limits: Limits, threads: int) -> None:
        self.store = store
        self.limits = limits
        self.threads = threads
        self.core = max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
        self.launcher = Launcher(threads)
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
                if cell.method.not_installed:
                    yield cell, not_installed(cell.job, cell.method, self.store, self.limits, self.threads)
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
        request = request_of(job.cell.job, self.store, folder, self.threads)
        request = replace(request, core=self.core, repeat_s=REPEAT_S)
        ended, report = execute(request, job.cell.method.requires, self.launcher, self.limits, self.stop)
        if ended.kind == outcome.OK:
            job.round_s.append(median(report.pop("solves_s")))
            job.waited = max(job.waited, report.pop("waited"))
        if not job.report or ended.kind != outcome.OK:
            job.ended, job.report = ended, report

    def _stored(self, job: "_Timed") -> dict[str, Any]:
        report = dict(job.report)
        if job.ended.kind == outcome.OK:
            report |= {"solve_s": median(job.round_s), "min_s": min(job.round_s)}
            report |= {"round_s": job.round_s, "waited": job.waited}
        requires = job.cell.method.requires
        record = record_of(asdict(job.cell.job), requires, self.limits, self.threads, job.ended, report)
        estimate = job.folder / "0" / ESTIMATE_FILE
        self.store.add_record(job.cell.job.id, record, estimate if job.ended.kind == outcome.OK else None)
        return record


class _Timed:
    """A cell with what its rounds have told so far."""

    def __init__(self, cell: Cell, folder: Path) -> None:
        self.cell = cell
        self.folder = folder
        self.ended = Outcome(outcome.NOT_RUN)
        self.report: dict[str, Any] = {}
        self.round_s: list[float] = []
        self.waited = 0.0

    @property
    def over(self) -> bool:
        """Whether there is nothing more to run."""
        failed = self.ended.kind not in (outcome.OK, outcome.NOT_RUN)
        return failed or len(self.round_s) == self.cell.job.rounds
