"""Run one job: start its child, watch it, and turn whatever happened into a record."""

import threading
import time
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bench import provenance
from bench.execution import outcome
from bench.execution.child import Request
from bench.execution.launch import LOG_FILE, Launcher, LaunchError
from bench.execution.outcome import Outcome
from bench.execution.report import read_report
from bench.execution.supervise import Limits, supervise

LOG_TAIL = 4000  # characters of the child's output that a record keeps


def execute(
    request: Request, requires: tuple[str, ...], launcher: Launcher, limits: Limits, stop: threading.Event
) -> tuple[Outcome, dict[str, Any]]:
    """Run one request in a supervised child.

    Returns
    -------
    The outcome, and what the child reported: its scalars, `wall_s`, and `log` where the outcome is not ``ok``.
    """
    start = time.monotonic()
    folder = Path(request.folder)
    report: dict[str, Any] = {}
    try:
        ended = supervise(launcher.start(request, requires), limits, stop)
    except LaunchError as error:
        ended = Outcome(outcome.CRASHED, str(error))
    if isinstance(ended, int):
        ended, report = read_report(folder) or (outcome.crashed(ended), {})
    report["wall_s"] = time.monotonic() - start
    if ended.kind != outcome.OK:
        report["log"] = _tail(folder / LOG_FILE)
    return ended, report


def record_of(
    job: Mapping[str, Any],
    requires: tuple[str, ...],
    limits: Limits,
    ended: Outcome,
    report: Mapping[str, Any],
) -> dict[str, Any]:
    """Everything that is kept of a job besides its arrays."""
    return {
        "job": dict(job),
        "outcome": ended.kind,
        "status": ended.text,
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "limits": {"seconds": limits.seconds, "memory_gib": limits.memory_gib},
        "versions": provenance.versions(requires),
        "provenance": provenance.of_this_run(),
        **report,
    }


def _tail(path: Path) -> str:
    try:
        with path.open("rb") as file:
            file.seek(max(path.stat().st_size - LOG_TAIL, 0))
            return file.read().decode(errors="replace")
    except FileNotFoundError:
        return ""
