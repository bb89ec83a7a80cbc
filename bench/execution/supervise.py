"""Watch one child: wall clock and memory limits, TERM then KILL for its whole process group."""

import contextlib
import os
import signal
import threading
import time
from dataclasses import dataclass

import psutil

from bench.execution import outcome
from bench.execution.launch import Child
from bench.execution.outcome import Outcome

POLL_S = 0.1
GRACE_S = 1.0


@dataclass(frozen=True)
class Limits:
    """What a job may use: wall clock seconds, and GiB of resident memory of the child and its descendants."""

    seconds: float
    memory_gib: float


class Interrupted(Exception):  # noqa: N818 - the user's wish, not an error
    """The run was asked to stop while the job was running."""


def supervise(child: Child, limits: Limits, stop: threading.Event) -> Outcome | int:
    """Wait for the child to end; return its exit code, or the outcome where a limit ended it.

    However this returns, no process of the child's group is left. Raises `Interrupted` once `stop` is set.
    The memory that counts is resident memory: a limit on address space makes numerical libraries hang at import.
    """
    deadline = time.monotonic() + limits.seconds
    try:
        while True:
            remaining = deadline - time.monotonic()
            code = child.wait(max(min(POLL_S, remaining), 0.001))
            if code is not None:
                return code
            if stop.is_set():
                raise Interrupted
            if remaining <= 0:
                return Outcome(outcome.TIMEOUT, f"{limits.seconds:g} s")
            if _resident_gib(child.pid) > limits.memory_gib:
                return Outcome(outcome.OUT_OF_MEMORY, f"{limits.memory_gib:g} GiB")
    finally:
        _end(child)


def _end(child: Child) -> None:
    """End the child, and whatever it left behind."""
    family = _family(child.pid)
    if family and child.wait(0.001) is None:
        _signal_group(child.pid, "SIGTERM")
        for process in family:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.terminate()
        child.wait(GRACE_S)
    _signal_group(child.pid, "SIGKILL")
    for process in [*family, *_family(child.pid)]:
        with contextlib.suppress(psutil.NoSuchProcess):
            process.kill()


def _signal_group(pid: int, name: str) -> None:
    """Signal the process group that the child leads, where the system has such groups."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(pid, getattr(signal, name))


def _family(pid: int) -> list[psutil.Process]:
    """Return the process and its descendants, without those that have ended but were not yet waited for."""
    try:
        leader = psutil.Process(pid)
        family = [leader, *leader.children(recursive=True)]
        return [p for p in family if p.status() != psutil.STATUS_ZOMBIE]
    except psutil.NoSuchProcess:
        return []


def _resident_gib(pid: int) -> float:
    total = 0
    for process in _family(pid):
        with contextlib.suppress(psutil.NoSuchProcess):
            total += process.memory_info().rss
    return total / 2**30
