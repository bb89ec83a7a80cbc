"""How a job can end. Every job ends in exactly one of these, and every one is a row of the table."""

import signal
from dataclasses import dataclass

OK = "ok"
TIMEOUT = "timeout"
OUT_OF_MEMORY = "out-of-memory"
CRASHED = "crashed"
ERROR = "error"
INVALID_OUTPUT = "invalid-output"
SKIPPED = "skipped"
NOT_INSTALLED = "not-installed"
NOT_RUN = "not-run"  # planned, no record yet

DETAIL_LENGTH = 300


@dataclass(frozen=True)
class Outcome:
    """A word of the vocabulary, with its reason where it has one."""

    kind: str
    detail: str = ""

    @property
    def text(self) -> str:
        """``ok``, ``timeout``, ``crashed(SIGSEGV)``, ``error(message)``…"""
        detail = " ".join(self.detail.split())
        if len(detail) > DETAIL_LENGTH:
            detail = detail[: DETAIL_LENGTH - 1] + "…"
        return f"{self.kind}({detail})" if detail else self.kind


def crashed(exit_code: int, by_kernel: bool = False) -> Outcome:
    """Outcome of a child that ended without leaving a result, and not because a limit ended it.

    Parameters
    ----------
    exit_code
        Minus the signal's number where a signal ended it.
    by_kernel
        Whether the kernel has killed processes for want of memory while it ran.
    """
    if exit_code >= 0:
        return Outcome(CRASHED, f"exit code {exit_code}")
    if exit_code == -9:
        return (
            Outcome(OUT_OF_MEMORY, "killed by the kernel: the machine has no more")
            if by_kernel
            else Outcome(CRASHED, "SIGKILL, from outside the benchmark")
        )
    try:
        return Outcome(CRASHED, signal.Signals(-exit_code).name)
    except ValueError:
        return Outcome(CRASHED, f"signal {-exit_code}")


def kernel_kills() -> int:
    """How many processes Linux has killed since it started because memory ran out; zero elsewhere."""
    try:
        with open("/proc/vmstat", "rb") as file:
            return int(file.read().partition(b"\noom_kill ")[2].split(None, 1)[0])
    except (OSError, IndexError):
        return 0
