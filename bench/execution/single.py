"""Solve problems one by one in supervised children, outside any run."""

import tempfile
import threading
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from bench.core import outcome
from bench.core.outcome import Outcome
from bench.core.problem import Estimate, Problem
from bench.execution.child import Request
from bench.execution.job import execute
from bench.execution.launch import Launcher
from bench.execution.output import ESTIMATE_FILE
from bench.execution.supervise import Limits
from bench.plugins.declare import Info
from bench.storage.arrays import load_estimate, save_problem

Answer = tuple[Outcome, dict[str, Any], Estimate | None]


class SingleSolver:
    """A configured method that can be given one problem after another; a context manager.

    It warms up before the first problem; the time of later ones includes what they load.

    Parameters
    ----------
    info, parameters
        The method and the parameters given.
    limits
        Of each problem.
    threads
        How many threads the numerical libraries may use.
    """

    def __init__(self, info: Info, parameters: Mapping[str, Any], limits: Limits, threads: int = 1) -> None:
        self.info = info
        self.parameters = dict(parameters)
        self.limits = limits
        self.threads = threads
        self.launcher = Launcher(threads)
        self._warm_up = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.launcher.close()

    def solve(self, problem: Problem, seed: int = 0) -> Answer:
        """Outcome, the child's report and, where the outcome is ``ok``, the estimate."""
        if self.info.not_installed:
            return Outcome(outcome.NOT_INSTALLED, self.info.install_hint), {}, None
        with tempfile.TemporaryDirectory(prefix="rotsync-") as name:
            folder = Path(name)
            save_problem(folder / "problem.npz", problem)
            request = Request(
                problem=str(folder / "problem.npz"),
                origin=self.info.origin,
                method=self.info.name,
                parameters=self.parameters,
                seed=seed,
                threads=self.threads,
                folder=name,
                warm_up=self._warm_up,
            )
            self._warm_up = False
            ended, report = execute(request, self.info.requires, self.launcher, self.limits, threading.Event())
            ok = ended.kind == outcome.OK
            return ended, report, load_estimate(folder / ESTIMATE_FILE, report) if ok else None
