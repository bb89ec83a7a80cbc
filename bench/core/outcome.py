"""How a job can end. Every job ends in exactly one of these, and every one is a row of the table."""

import signal
from dataclasses import dataclass
from typing import Final, Literal

Kind = Literal[
    "ok",
    "timeout",
    "out-of-memory",
    "crashed",
    "error",
    "invalid-output",
    "skipped",
    "not-installed",
    "not-run",
]
OK: Final = "ok"
TIMEOUT: Final = "timeout"
OUT_OF_MEMORY: Final = "out-of-memory"
CRASHED: Final = "crashed"
ERROR: Final = "error"
INVALID_OUTPUT: Final = "invalid-output"
SKIPPED: Final = "skipped"
NOT_INSTALLED: Final = "not-installed"
NOT_RUN: Final = "not-run"  # planned, no record yet

DETAIL_LENGTH = 300


@dataclass(frozen=True)
class Outcome:
    """A word of the vocabulary, with its reason where it has one: a line of at most `DETAIL_LENGTH` characters."""

    kind: Kind
    detail: str = ""

    def __post_init__(self) -> None:
        """Bring the reason, which a plug-in may have written, on one line."""
        detail = " ".join(self.detail.split())
        if len(detail) > DETAIL_LENGTH:
            detail = detail[: DETAIL_LENGTH - 1] + "…"
        object.__setattr__(self, "detail", detail)

    @property
    def ok(self) -> bool:
        """Whether there is an estimate."""
        return self.kind == OK

    @property
    def text(self) -> str:
        """``ok``, ``timeout``, ``crashed(SIGSEGV)``, ``error(message)``…"""
        return f"{self.kind}({self.detail})" if self.detail else self.kind


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
