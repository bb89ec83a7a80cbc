"""The processes of a job: the one that runs the method, and whatever that starts.

Linux tells the children of a process in one small file; elsewhere psutil looks at every process of the machine.
"""

import contextlib
import os
import signal
import sys
from collections.abc import Iterable

GRACE_S = 1.0  # between TERM and KILL
LISTED = os.path.exists("/proc/thread-self/children")  # not every Linux kernel is built with it
ROUNDS = 50  # of looking for processes that were started while others were being stopped


def family(pid: int) -> list[int]:
    """Process ids of a process and of its descendants, itself first."""
    found = [pid]
    for parent in found:  # grows on the way
        found += children(parent)
    return found


def children(pid: int) -> list[int]:
    """Process ids of the children of a process, those included that have ended and were not waited for."""
    if not LISTED:
        return _children_by_psutil(pid)
    found: list[int] = []
    with contextlib.suppress(OSError):
        for thread in os.listdir(f"/proc/{pid}/task"):
            with open(f"/proc/{pid}/task/{thread}/children", "rb") as file:
                found += map(int, file.read().split())
    return found


def _children_by_psutil(pid: int) -> list[int]:
    import psutil

    try:
        return [child.pid for child in psutil.Process(pid).children()]
    except psutil.NoSuchProcess:
        return []


def resident_gib(pids: Iterable[int]) -> float:
    """Resident memory of the processes together; what they share counts for each."""
    return sum(map(_resident_bytes, pids)) / 2**30


def _resident_bytes(pid: int) -> int:
    if sys.platform == "linux":
        with contextlib.suppress(OSError), open(f"/proc/{pid}/statm", "rb") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
        return 0
    import psutil

    with contextlib.suppress(psutil.Error):
        return psutil.Process(pid).memory_info().rss
    return 0


def terminate(pid: int) -> None:
    """Ask a process and its descendants to end; those that are stopped are woken to hear it."""
    for member in family(pid):
        send(member, "SIGTERM")
        send(member, "SIGCONT")


def kill(pid: int) -> None:
    """Kill a process and its descendants. All are stopped before the first is killed, so that none starts another."""
    stopped: set[int] = set()
    for _ in range(ROUNDS):
        if not (new := set(family(pid)) - stopped):
            break
        for member in new:
            send(member, "SIGSTOP")
        stopped |= new
    for member in stopped:
        send(member, "SIGKILL")


def send(pid: int, name: str) -> None:
    """Signal a process, if it is still there; Windows knows only one way, and that ends it."""
    number = getattr(signal, name, None)
    if number is None:
        if name != "SIGKILL":
            return
        number = signal.SIGTERM
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.kill(pid, number)
