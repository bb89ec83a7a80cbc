"""Run one request: start its child, watch it, and tell how it ended, whatever happened."""

import threading
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from bench.core import outcome
from bench.core.errors import InputError
from bench.core.limits import Limits
from bench.core.outcome import Outcome
from bench.execution import provenance
from bench.execution.child import Request
from bench.execution.launch import Launcher, LaunchError, ServerLostError
from bench.execution.output import BEGUN_FILE, Result, UnusableError, read_output
from bench.execution.supervise import supervise
from bench.storage.record import Record, Report
from bench.suite.plan import Job

LOG_OF_OK = 1000  # characters of the output of a job that ended well; others keep all that `log.Tail` has


@dataclass(frozen=True)
class Ended:
    """A request that was run.

    Parameters
    ----------
    outcome, report
        How it ended, and what its child told.
    wall_s, log
        Seconds from the start of the child to its end, and the end of what it printed.
    """

    outcome: Outcome
    report: Report = field(default_factory=Report)
    wall_s: float = 0.0
    log: str = ""

    def record(self, job: Job, requires: tuple[str, ...], limits: Limits) -> Record:
        """Everything that is kept of the job besides its arrays."""
        return Record(
            job,
            self.outcome,
            limits,
            finished=datetime.now(UTC).isoformat(timespec="seconds"),
            versions=provenance.versions(requires),
            provenance=provenance.of_this_run(),
            report=self.report,
            wall_s=self.wall_s,
            log=self.log,
        )


def execute(
    request: Request, requires: tuple[str, ...], launcher: Launcher, limits: Limits, stop: threading.Event
) -> Ended:
    """Run one request in a supervised child.

    A job whose fork server dies is started once more: it may have been another's fault.
    """
    start = time.monotonic()
    try:
        try:
            result, log = _attempt(request, requires, launcher, limits, stop)
        except ServerLostError:
            result, log = _attempt(request, requires, launcher, limits, stop)
    except (LaunchError, ServerLostError) as error:
        result, log = Result(Outcome(outcome.CRASHED, str(error)), Report()), ""
    return Ended(result.outcome, result.report, time.monotonic() - start, log)


def _attempt(
    request: Request, requires: tuple[str, ...], launcher: Launcher, limits: Limits, stop: threading.Event
) -> tuple[Result, str]:
    kills = outcome.kernel_kills()
    begun = Path(request.folder, BEGUN_FILE)
    begun.unlink(missing_ok=True)
    child = launcher.start(request, requires)
    ended = supervise(child, limits, stop, begun.exists)
    result = Result(ended, Report()) if isinstance(ended, Outcome) else _left(Path(request.folder), ended, kills)
    log = child.log[-LOG_OF_OK:] if result.outcome.ok else child.log
    return result, log if log.strip() else ""


def _left(folder: Path, code: int, kills: int) -> Result:
    """What a child that ended by itself has left; `kills` is `outcome.kernel_kills` from before it was started."""
    try:
        read = read_output(folder)
    except UnusableError as error:
        return Result(Outcome(outcome.INVALID_OUTPUT, str(error)), Report())
    if read is not None and read.disk_full:
        raise InputError(f"{folder}: {read.disk_full}; what is finished is kept, and the same command continues")
    return read or Result(outcome.crashed(code, by_kernel=outcome.kernel_kills() > kills), Report())
