"""Run one job: start its child, watch it, and turn whatever happened into a record."""

import threading
import time
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bench.core import outcome
from bench.core.errors import InputError
from bench.core.outcome import Outcome
from bench.execution import provenance
from bench.execution.child import Request
from bench.execution.launch import Launcher, LaunchError, ServerLostError
from bench.execution.output import DISK_FULL, UnusableError, read_output
from bench.execution.supervise import Limits, supervise

LOG_OF_OK = 1000  # characters of the output of a job that ended well; others keep all that `log.Tail` has


def execute(
    request: Request, requires: tuple[str, ...], launcher: Launcher, limits: Limits, stop: threading.Event
) -> tuple[Outcome, dict[str, Any]]:
    """Run one request in a supervised child.

    A job whose fork server dies is started once more: it may have been another's fault.

    Returns
    -------
    The outcome, and what the child reported: its scalars, `wall_s`, and `log`, the end of its output where it had any.
    """
    start = time.monotonic()
    try:
        try:
            ended, report = _attempt(request, requires, launcher, limits, stop)
        except ServerLostError:
            ended, report = _attempt(request, requires, launcher, limits, stop)
    except (LaunchError, ServerLostError) as error:
        ended, report = Outcome(outcome.CRASHED, str(error)), {}
    return ended, report | {"wall_s": time.monotonic() - start}


def _attempt(
    request: Request, requires: tuple[str, ...], launcher: Launcher, limits: Limits, stop: threading.Event
) -> tuple[Outcome, dict[str, Any]]:
    kills = outcome.kernel_kills()
    child = launcher.start(request, requires)
    ended = supervise(child, limits, stop)
    report: dict[str, Any] = {}
    if isinstance(ended, int):
        ended, report = _reported(Path(request.folder), ended, kills)
    log = child.log if ended.kind != outcome.OK else child.log[-LOG_OF_OK:]
    return ended, report | ({"log": log} if log.strip() else {})


def _reported(folder: Path, code: int, kills: int) -> tuple[Outcome, dict[str, Any]]:
    """What a child that ended by itself has left; `kills` is `outcome.kernel_kills` from before it was started."""
    try:
        read = read_output(folder)
        if read is not None and DISK_FULL in read[1]:
            raise InputError(
                f"{folder}: {read[1][DISK_FULL]}; what is finished is kept, and the same command continues"
            )
        return read or (outcome.crashed(code, by_kernel=outcome.kernel_kills() > kills), {})
    except UnusableError as error:
        return Outcome(outcome.INVALID_OUTPUT, str(error)), {}


def record_of(
    job: Mapping[str, Any],
    requires: tuple[str, ...],
    limits: Limits,
    threads: int,
    ended: Outcome,
    report: Mapping[str, Any],
) -> dict[str, Any]:
    """Everything that is kept of a job besides its arrays."""
    return {
        "job": dict(job),
        "outcome": ended.kind,
        "status": ended.text,
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "limits": {"seconds": limits.seconds, "memory_gib": limits.memory_gib, "threads": threads},
        "versions": provenance.versions(requires),
        "provenance": provenance.of_this_run(),
        **report,
    }
