"""Solve problems one by one in supervised children, outside any run."""

import tempfile
import threading
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from bench.core import outcome
from bench.core.limits import Limits
from bench.core.outcome import Outcome
from bench.core.problem import Estimate, Information, Problem
from bench.execution.child import Request
from bench.execution.execute import Ended, execute
from bench.execution.launch import Launcher
from bench.execution.output import ESTIMATE_FILE
from bench.plugins.declare import MethodInfo
from bench.storage.arrays import load_estimate, save_problem
from bench.storage.record import Report


class Answer(NamedTuple):
    """How a solution ended, what its child told, the estimate where the outcome is ``ok``, and what was printed."""

    outcome: Outcome
    report: Report
    estimate: Estimate | None
    log: str = ""


class SingleSolver:
    """A configured method that can be given one problem after another; a context manager.

    It warms up before the first problem; the time of later ones includes what they load.

    Parameters
    ----------
    info, parameters
        The method and the parameters given.
    limits
        Of each problem.
    use
        What it may use of what comes with the measurements; None for all.
    launcher
        Starts the processes; None for one of its own, which it closes.
    """

    def __init__(
        self,
        info: MethodInfo,
        parameters: Mapping[str, Any],
        limits: Limits,
        use: tuple[Information, ...] | None = None,
        launcher: Launcher | None = None,
    ) -> None:
        self.info = info
        self.parameters = dict(parameters)
        self.limits = limits
        self.use = use
        self.launcher = launcher or Launcher(limits.threads)
        self._closes = launcher is None
        self._warm_up = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._closes:
            self.launcher.close()

    def solve(self, problem: Problem, seed: int = 0) -> Answer:
        """Solve one problem."""
        if self.info.not_installed(self.parameters):
            hint = self.info.install_hint(self.parameters)
            return Answer(Outcome(outcome.NOT_INSTALLED, hint), Report(), None)
        with tempfile.TemporaryDirectory(prefix="rotsync-") as name:
            request = request_in(Path(name), self.info, self.parameters, problem, seed, self.limits.threads)
            request = replace(request, warm_up=self._warm_up, use=self.use)
            self._warm_up = False
            requires = self.info.requires_of(self.parameters)
            ended = execute(request, requires, self.launcher, self.limits, threading.Event())
            return answer(ended, Path(name))


def request_in(
    folder: Path, info: MethodInfo, parameters: Mapping[str, Any], problem: Problem, seed: int, threads: int
) -> Request:
    """A request whose problem lies in the folder that its results go to."""
    path = folder / "problem.npz"
    save_problem(path, problem)
    return Request(str(path), info.origin, info.name, dict(parameters), seed, threads, str(folder))


def answer(ended: Ended, folder: Path) -> Answer:
    """The answer of a request that was run, with its estimate from the folder of its results."""
    estimate = load_estimate(folder / ESTIMATE_FILE, ended.report) if ended.outcome.ok else None
    return Answer(ended.outcome, ended.report, estimate, ended.log)
