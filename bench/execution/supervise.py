"""Watch one child: wall clock and memory limits."""

import threading
import time
from collections.abc import Callable

from bench.core import outcome
from bench.core.limits import Limits
from bench.core.outcome import Outcome
from bench.execution import processes
from bench.execution.launch import Child

SHORTEST_S, LONGEST_S = 0.01, 0.1  # between two looks at a child
FASTEST_GIB_S = 4.0  # how fast a process may be thought to fill memory
PREPARING_S = 120.0  # for a method to compile its kernels and to load what it needs, where its limit is no longer


class Interrupted(Exception):  # noqa: N818 - the user's wish, not an error
    """The run was asked to stop while the job was running."""


def supervise(child: Child, limits: Limits, stop: threading.Event, begun: Callable[[], bool]) -> int | Outcome:
    """Wait for the child to end; return its exit code, or the outcome where a limit ended it.

    The wall clock starts once the method has `begun`, lest it depend on what is compiled already whether it is done
    in time; until then the child has as long, or `PREPARING_S`. However this returns, nothing that the child started
    is left. The memory that counts is resident memory: a limit on address space makes numerical libraries hang at
    import. The nearer a child is to its limit, the more often its memory is looked at.

    Raises
    ------
    Interrupted
        Once `stop` is set.
    ServerLostError
        Where the child died with its server.
    """
    preparing_s = max(PREPARING_S, limits.seconds)
    deadline, solving = time.monotonic() + preparing_s, False
    used_gib = 0.0
    try:
        while True:
            remaining = deadline - time.monotonic()
            pause = max((limits.memory_gib - used_gib) / FASTEST_GIB_S, SHORTEST_S)
            code = child.wait(max(min(pause, LONGEST_S, remaining), 0.001))
            if code is not None:
                return code
            if stop.is_set():
                raise Interrupted
            if not solving and begun():
                deadline, solving = time.monotonic() + limits.seconds, True
            elif remaining <= 0:
                return Outcome(outcome.TIMEOUT, f"{limits.seconds:g} s" if solving else f"{preparing_s:g} s to begin")
            used_gib = processes.resident_gib(processes.family(child.pid))
            if used_gib > limits.memory_gib:
                return Outcome(outcome.OUT_OF_MEMORY, f"{limits.memory_gib:g} GiB")
    finally:
        child.end()
