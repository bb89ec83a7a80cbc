"""A process that has imported what methods require, and forks one child for each job.

A fork saves every job the start of an interpreter and the import of its libraries. The standard library's
fork server is not used because it re-imports the caller's main script in every child.

Messages are lines of JSON on a socket pair. To the server: ``{"id", "request"}`` starts a job, ``{"id", "end"}``
ends it. From it: ``{"id", "pid"}`` when the child is there, or ``{"id", "refused"}`` when the system starts no
more; ``{"id", "exit", "log"}`` when it and all that it started are gone, with the end of what it printed. When the
socket closes, because the harness ended for whatever reason, the server kills what is left and goes.

On Linux a process whose parent dies becomes a child of the job's process, and when that ends, of the server: so
nothing that a job starts can hide, whatever process group, session or parent it takes.
"""

import contextlib
import faulthandler
import gc
import importlib
import json
import os
import resource
import selectors
import signal
import socket
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from bench.execution import processes
from bench.execution.log import Tail
from bench.execution.warmth import Warmth

if TYPE_CHECKING:
    from bench.execution import child

PRELOADED = (
    "bench.execution.child",
    "scipy.linalg",
    "scipy.sparse.csgraph",
    "scipy.sparse.linalg",
    "threadpoolctl",
)
SWEEP_S = 5.0  # at most, for what a job has left behind
PIPE_BYTES = 65536
LARGE_BYTES = 2**18  # of a problem that the server does not load: that takes more than a few milliseconds
DRAIN = 16  # reads at most of what is left in the pipe of a job that has ended
_SET_PARENT_DEATH_SIGNAL, _SET_CHILD_SUBREAPER = 1, 36  # of Linux's prctl


def main() -> None:
    """Serve; the arguments are a file descriptor, threads to pin, seconds for imports, and modules to import."""
    connection = socket.socket(fileno=int(sys.argv[1]))
    signal.alarm(int(sys.argv[3]))  # ends this process: an import may hang where no Python code runs
    for name in [*PRELOADED, *sys.argv[4:]]:
        with contextlib.suppress(Exception, SystemExit):  # the child imports it again, and reports the error in its row
            importlib.import_module(name)
    if "numba" in sys.modules:
        _start_numba()
    _rehearse(threads=int(sys.argv[2]))
    signal.alarm(0)
    with contextlib.suppress(OSError):  # where the kernel runs out of memory, a job ends and not the harness
        Path("/proc/self/oom_score_adj").write_text("500")
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
    faulthandler.enable()  # a child that crashes says where
    gc.collect()
    gc.freeze()  # children share these pages instead of copying them at their first collection
    _Server(connection).serve()


def _start_numba() -> None:
    """Compile something: numba sets up its compiler at the first call, half a second that no child need spend again."""
    import numba

    numba.njit(lambda x: x + 1)(1)


def _rehearse(threads: int) -> None:
    """Run a job in this process: what libraries put off to their first call is done once, not in every child."""
    import numpy as np

    from bench.core.problem import Problem
    from bench.execution import child, rehearsal
    from bench.storage.arrays import save_problem

    with tempfile.TemporaryDirectory(prefix="rotsync-") as folder:
        path = Path(folder, "problem.npz")
        save_problem(path, Problem(3, np.array([(0, 1), (1, 2)]), np.tile(np.eye(3), (2, 1, 1))))
        child.run(child.Request(str(path), rehearsal.__name__, rehearsal.NAME, {}, 0, threads, folder))


@dataclass
class _Job:
    """A job that runs: its number and request, its process, the pipe it prints to, and when to kill it, if it is to."""

    number: int
    request: dict[str, Any]
    pid: int
    pipe: int
    log: Tail = field(default_factory=Tail)
    kill_at: float = float("inf")

    def read(self) -> bool:
        """Read what was printed; False where there was nothing."""
        try:
            printed = os.read(self.pipe, PIPE_BYTES)
        except BlockingIOError:
            return False
        self.log.add(printed)
        return bool(printed)


class _Server:
    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.pending = b""
        self.jobs: dict[int, _Job] = {}  # by pid
        self.warmth = Warmth()
        self.helpers = set(processes.children(os.getpid()))  # that libraries have started
        self.prctl = _prctl()
        self.prctl(_SET_CHILD_SUBREAPER, 1)
        self.wakeup, self.wakeup_end = os.pipe()
        for end in (self.wakeup, self.wakeup_end):
            os.set_blocking(end, False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.set_wakeup_fd(self.wakeup_end, warn_on_full_buffer=False)
        self.selector = selectors.DefaultSelector()
        self.selector.register(self.connection, selectors.EVENT_READ, self._receive)
        self.selector.register(self.wakeup, selectors.EVENT_READ, self._reap)

    def serve(self) -> NoReturn:
        while True:
            next_kill = min((job.kill_at for job in self.jobs.values()), default=float("inf"))
            timeout = None if next_kill == float("inf") else max(next_kill - time.monotonic(), 0)
            for key, _ in self.selector.select(timeout):
                key.data()
            for job in self.jobs.values():
                if job.kill_at <= time.monotonic():
                    job.kill_at = float("inf")
                    processes.kill(job.pid)

    def _receive(self) -> None:
        received = b""
        with contextlib.suppress(ConnectionResetError):
            received = self.connection.recv(PIPE_BYTES)
        if not received:
            self._kill_all()
        *lines, self.pending = (self.pending + received).split(b"\n")
        for line in lines:
            message = json.loads(line)
            if "request" in message:
                self._fork(message["id"], message["request"])
            else:
                self._end(message["id"])

    def _fork(self, number: int, request: dict[str, Any]) -> None:
        prepared = _prepared(request)
        if prepared is not None:
            self.warmth.warm_up(request, prepared)
        read_end, write_end = os.pipe()
        try:
            pid = os.fork()
        except OSError as error:  # no more processes, or no memory for one
            os.close(read_end)
            os.close(write_end)
            self._send({"id": number, "refused": str(error)})
            return
        if pid == 0:
            self._be_the_child(request, prepared, read_end, write_end)
        os.close(write_end)
        os.set_blocking(read_end, False)
        job = self.jobs[pid] = _Job(number, request, pid, read_end)
        self.selector.register(read_end, selectors.EVENT_READ, lambda: self._read(job))
        self._send({"id": number, "pid": pid})

    def _be_the_child(
        self, request: dict[str, Any], prepared: "child.Prepared | None", read_end: int, write_end: int
    ) -> NoReturn:
        code = 1
        try:
            self.prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
            self.prctl(_SET_CHILD_SUBREAPER, 1)
            os.setsid()
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            os.dup2(write_end, 1)
            os.dup2(write_end, 2)
            self.connection.close()
            for end in (read_end, write_end, self.wakeup, self.wakeup_end, *(job.pipe for job in self.jobs.values())):
                os.close(end)
            from bench.execution import child

            child.run(child.Request(**request), prepared)
            sys.stdout.flush()
            sys.stderr.flush()
            code = 0
        finally:
            os._exit(code)

    def _read(self, job: _Job) -> None:
        if self.jobs.get(job.pid) is job and not job.read():
            self.selector.unregister(job.pipe)  # closed by the child, which may go on without it

    def _end(self, number: int) -> None:
        for job in self.jobs.values():
            if job.number == number:
                job.kill_at = time.monotonic() + processes.GRACE_S
                processes.terminate(job.pid)

    def _reap(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.read(self.wakeup, PIPE_BYTES)
        ended = []
        with contextlib.suppress(ChildProcessError):
            while (found := os.waitpid(-1, os.WNOHANG)) != (0, 0):
                pid, status = found
                if pid in self.jobs:
                    ended.append((self.jobs.pop(pid), os.waitstatus_to_exitcode(status)))
        if ended:
            self._sweep()
        for job, code in ended:
            self._finish(job, code)

    def _finish(self, job: _Job, code: int) -> None:
        for _ in range(DRAIN):
            if not job.read():
                break
        with contextlib.suppress(KeyError):
            self.selector.unregister(job.pipe)
        os.close(job.pipe)
        if code == 0:
            self.warmth.prove(job.request)
        self._send({"id": job.number, "exit": code, "log": job.log.text})

    def _sweep(self) -> None:
        """Kill what jobs that have ended left behind: it is this process's own child now."""
        deadline = time.monotonic() + SWEEP_S
        while (
            left := set(processes.children(os.getpid())) - set(self.jobs) - self.helpers
        ) and time.monotonic() < deadline:
            for pid in left:
                processes.kill(pid)
            time.sleep(0.001)
            for pid in left:
                with contextlib.suppress(ChildProcessError):
                    os.waitpid(pid, os.WNOHANG)

    def _send(self, message: dict[str, Any]) -> None:
        with contextlib.suppress(OSError):
            self.connection.sendall(json.dumps(message).encode() + b"\n")

    def _kill_all(self) -> NoReturn:
        for pid in self.jobs:
            processes.kill(pid)
        self.jobs.clear()
        self.helpers.clear()
        self._sweep()
        os._exit(0)


def _prepared(request: dict[str, Any]) -> "child.Prepared | None":
    """What the child of a request needs, made here, where it costs a fraction: a fork copies what it touches.

    None where that goes wrong or has something to say, or where the problem is large: then it is left to the child,
    which reports it, and which others need not wait for.
    """
    from bench.execution import child, threads

    modules = len(sys.modules)
    try:
        if os.path.getsize(request["problem"]) > LARGE_BYTES:
            return None
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return child.prepare(child.Request(**request))
    except (Exception, SystemExit):
        return None
    finally:
        if len(sys.modules) > modules:
            threads.find_libraries()
            gc.freeze()


def _prctl() -> Callable[[int, int], Any]:
    """Linux's prctl; elsewhere something that does nothing."""
    if sys.platform != "linux":
        return lambda option, value: None
    import ctypes

    prctl = ctypes.CDLL(None).prctl
    return lambda option, value: prctl(option, ctypes.c_ulong(value))


if __name__ == "__main__":
    main()
