"""A plug-in whose method ends in every way that a native solver, a leaking library or a bug can end a process."""

import json
import os
import signal
import sys
import time
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench import Floats, Problem, method, so3


@method("chaos", title="Chaos", deterministic=False)
@dataclass(frozen=True)
class Chaos:
    """Random rotations, after the fault of that name; `copy` makes different jobs of the same."""

    fault: str = "well"
    copy: int = 0

    def solve(self, problem: Problem, rng: np.random.Generator) -> Floats:
        """Misbehave, and answer where the fault allows it; leave a line that tells which job it was that started."""
        if "CHAOS_STARTS" in os.environ:
            with open(os.environ["CHAOS_STARTS"], "a") as file:
                file.write(f"{self.fault} {self.copy} {zlib.crc32(problem.rotations.tobytes())}\n")
        getattr(self, self.fault)()
        return so3.random(rng, problem.n)

    def well(self) -> None:
        """Behave."""

    def segfault(self) -> None:
        """Touch memory that is not there."""
        os.kill(os.getpid(), signal.SIGSEGV)

    def abort(self) -> None:
        """End as C++ does when nobody catches."""
        os.abort()

    def leave(self) -> None:
        """Exit without a word."""
        os._exit(0)

    def killed(self) -> None:
        """End as at the hands of the kernel."""
        os.kill(os.getpid(), signal.SIGKILL)

    def kill_server(self) -> None:
        """Kill the process that started this one."""
        os.kill(os.getppid(), signal.SIGKILL)
        hang()

    def hang(self) -> None:
        """Hang, deaf to TERM, and so does a grandchild."""
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        start(hang)
        hang()

    def stop(self) -> None:
        """Stop itself."""
        os.kill(os.getpid(), signal.SIGSTOP)

    def endless(self) -> None:
        """Print without end."""
        while True:
            sys.stdout.write("and again and again\n" * 1000)

    def orphan(self) -> None:
        """Leave a grandchild that hangs."""
        start(hang)

    def twins(self) -> None:
        """Fork, and let both processes go on."""
        if os.fork():
            os.wait()

    def daemon(self) -> None:
        """Leave a grandchild that hangs in a session of its own, its parent gone."""
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        start(daemonise, hang)

    def bomb(self) -> None:
        """Start processes that start processes."""
        while True:
            start()

    def memory(self) -> None:
        """Allocate without end."""
        allocate()

    def hidden_memory(self) -> None:
        """Have a process in another session allocate without end."""
        start(daemonise, allocate)
        hang()

    def garbage(self) -> None:
        """Leave a result that is cut short."""
        whole = json.dumps
        json.dumps = lambda *given, **named: whole(*given, **named)[:30]

    def no_estimate(self) -> None:
        """Leave no estimate, and say that all is well."""
        np.savez = lambda *_, **__: None

    def cut_estimate(self) -> None:
        """Leave half an estimate, and say that all is well."""
        whole = np.savez

        def cut(file: Any, **arrays: Any) -> None:
            whole(file, **arrays)
            file.truncate(file.tell() // 2)

        np.savez = cut

    def slow(self) -> None:
        """Take a moment."""
        time.sleep(0.02)

    def chatter(self) -> None:
        """Print megabytes."""
        print("x" * 3_000_000)

    def close(self) -> None:
        """Close every file."""
        os.closerange(0, 256)


def start(*steps: Any) -> None:
    """Start a process that leaves its id and takes the steps; with none, both go on."""
    if os.fork() == 0:
        for step in steps:
            Path(os.environ["CHAOS_MARKS"], str(os.getpid())).touch()
            step()
        if steps:
            os._exit(0)
    elif steps and steps[0] is daemonise:
        os.wait()


def daemonise() -> None:
    """Move to another session, and let the parent die."""
    os.setsid()
    if os.fork():
        os._exit(0)


def hang() -> None:
    """Do nothing for long."""
    time.sleep(1000)


def allocate() -> None:
    """Fill memory."""
    kept = []
    while True:
        kept.append(np.ones(1_000_000))
