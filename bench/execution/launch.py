"""Start the child process of a job: forked from a server where the system can fork, else a fresh interpreter."""

import contextlib
import json
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
from dataclasses import asdict
from typing import Any, Protocol

import psutil

from bench.execution import processes
from bench.execution.child import Request
from bench.execution.fresh import FreshInterpreter
from bench.execution.processes import GRACE_S

IMPORT_LIMIT_S = 120  # for what a method requires
PATIENCE_S = 15.0  # for the server to do what takes it milliseconds, on a machine that is very busy
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)
CAN_FORK = hasattr(os, "fork") and sys.platform != "darwin"  # macOS libraries do not survive a fork


class LaunchError(RuntimeError):
    """The child could not be started."""


class ServerLostError(RuntimeError):
    """The server of a child died while the child was running."""


class Child(Protocol):
    """A process that runs one job, leader of its own process group.

    Once it has ended, nothing that it started is left, and `log` has the end of what it printed.
    """

    pid: int
    log: str

    def wait(self, timeout: float) -> int | None:
        """Exit code (minus the signal's number where a signal ended it), or None when it still runs.

        Raises
        ------
        ServerLostError
            Where its server died.
        """

    def end(self) -> None:
        """End it and what it started: TERM first, then KILL."""


class Launcher:
    """Starts children; keeps one fork server for each set of required modules.

    One server each, because libraries that different methods require may not live well together in one process.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self.environment = os.environ | {name: str(threads) for name in THREAD_VARIABLES}
        self.servers: dict[frozenset[str], _ForkServer] = {}
        self.lock = threading.Lock()

    def start(self, request: Request, requires: tuple[str, ...]) -> Child:
        """Start the job.

        Raises
        ------
        LaunchError
            Where the fork server hangs or dies while it imports what the method requires.
        ServerLostError
            Where it dies later.
        """
        if not CAN_FORK:
            return FreshInterpreter(request, self.environment)
        with self.lock:
            server = self.servers.get(libraries := frozenset(requires))
            if server is not None and not server.alive:
                server.close()
                server = None
            if server is None:
                server = self.servers[libraries] = _ForkServer(requires, self.threads, self.environment)
        return server.start(request)

    def close(self) -> None:
        """End the servers, and with them every child that still runs."""
        for server in self.servers.values():
            server.close()


class _ForkedChild:
    """Fed by the server's messages: first the pid, then how it ended; an empty one when the server is gone."""

    def __init__(self, server: "_ForkServer", number: int) -> None:
        self.server = server
        self.number = number
        self.messages: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self.pid = 0
        self.log = ""
        self.over = False
        self.descendants: set[psutil.Process] = set()  # that were seen; they know when a pid is another's

    def wait_for_pid(self) -> None:
        try:
            message = self.messages.get(timeout=IMPORT_LIMIT_S + PATIENCE_S)
        except queue.Empty:
            raise LaunchError(f"the fork server did not answer within {IMPORT_LIMIT_S + PATIENCE_S:g} s") from None
        if not message:
            raise self.server.loss()
        if "refused" in message:
            raise LaunchError(f"no process could be started: {message['refused']}")
        self.pid = message["pid"]

    def wait(self, timeout: float) -> int | None:
        try:
            message = self.messages.get(timeout=timeout)
        except queue.Empty:
            self._look()
            return None
        self.over = True
        if not message:
            self._kill_orphans()
            raise self.server.loss()
        self.log = message["log"]
        return message["exit"]

    def end(self) -> None:
        if not self.over:
            self.server.send({"id": self.number, "end": True})
            with contextlib.suppress(ServerLostError):
                self.wait(GRACE_S + PATIENCE_S)

    def _look(self) -> None:
        """Remember the descendants, for the day the server, which would find them, is gone."""
        known = {process.pid for process in self.descendants}
        for pid in processes.family(self.pid)[1:]:
            if pid not in known:
                with contextlib.suppress(psutil.NoSuchProcess):
                    self.descendants.add(psutil.Process(pid))

    def _kill_orphans(self) -> None:
        """Kill what a lost server has left: the child itself has ended with it, where the system can see to that."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)
        for process in self.descendants:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()


class _ForkServer:
    def __init__(self, modules: tuple[str, ...], threads: int, environment: dict[str, str]) -> None:
        self.socket, theirs = socket.socketpair()
        with theirs:
            arguments = [theirs.fileno(), threads, IMPORT_LIMIT_S, *modules]
            self.process = subprocess.Popen(
                [sys.executable, "-m", "bench.execution.server", *map(str, arguments)],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=environment,
                start_new_session=True,  # so that Ctrl-C reaches the harness alone
            )
        self.alive = True
        self.ready = False  # once it has started a child
        self.lock = threading.Lock()
        self.children: dict[int, _ForkedChild] = {}
        self.count = 0
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def start(self, request: Request) -> _ForkedChild:
        with self.lock:
            if not self.alive:
                raise self.loss()
            self.count += 1
            child = self.children[self.count] = _ForkedChild(self, self.count)
        self.send({"id": child.number, "request": asdict(request)})
        child.wait_for_pid()
        return child

    def send(self, message: dict[str, object]) -> None:
        with self.lock, contextlib.suppress(OSError):  # the reader tells the children that the server is gone
            self.socket.sendall(json.dumps(message).encode() + b"\n")

    def loss(self) -> LaunchError | ServerLostError:
        """What it means that the server is gone."""
        if self.ready:
            return ServerLostError("the fork server died while the job was running")
        took_long = self.process.wait() == -signal.SIGALRM
        what = f"took more than {IMPORT_LIMIT_S:g} s" if took_long else "died"
        return LaunchError(f"the fork server {what} while importing what the method requires")

    def _read(self) -> None:
        # A server that dies with unread messages resets the connection instead of closing it.
        with self.socket.makefile("rb") as lines, contextlib.suppress(ConnectionResetError):
            for line in lines:
                message = json.loads(line)
                if "pid" in message:
                    self.ready = True
                    self.children[message["id"]].messages.put(message)
                else:
                    self.children.pop(message["id"]).messages.put(message)
        with self.lock:
            self.alive = False
            for child in self.children.values():
                child.messages.put({})

    def close(self) -> None:
        if not self.ready:  # it may import for long before it looks at its socket
            self.process.kill()
        with contextlib.suppress(OSError):  # the server may have gone first
            self.socket.shutdown(socket.SHUT_RDWR)
        self.process.wait()
        self.reader.join()
        self.socket.close()
