"""Start the child process of a job: forked from a server where the system can fork, else a fresh interpreter."""

import contextlib
import json
import os
import queue
import socket
import subprocess
import sys
import threading
from dataclasses import asdict
from pathlib import Path
from typing import Protocol

from bench.execution.child import Request

LOG_FILE = "log.txt"
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)
CAN_FORK = hasattr(os, "fork") and sys.platform != "darwin"  # macOS libraries do not survive a fork
SERVER_GONE = "the fork server died while importing what the method requires"
START_TIMEOUT_S = 120.0  # the first job of a server waits for its imports


class LaunchError(RuntimeError):
    """The child could not be started."""


class Child(Protocol):
    """A process that runs one job, leader of its own process group."""

    pid: int

    def wait(self, timeout: float | None) -> int | None:
        """Exit code (minus the signal's number where a signal ended it), or None when it still runs."""


class Launcher:
    """Starts children; keeps one fork server for each set of required modules.

    One server each, because libraries that different methods require may not live well together in one process.
    """

    def __init__(self, threads: int) -> None:
        self.environment = os.environ | {name: str(threads) for name in THREAD_VARIABLES}
        self.servers: dict[tuple[str, ...], _ForkServer] = {}
        self.lock = threading.Lock()

    def start(self, request: Request, requires: tuple[str, ...]) -> Child:
        """Start the job; its output goes to `LOG_FILE` in the request's folder.

        Raises
        ------
        LaunchError
            Where the fork server hangs or dies while it imports what the method requires.
        """
        if not CAN_FORK:
            return _FreshInterpreter(request, self.environment)
        with self.lock:
            server = self.servers.get(requires)
            if server is not None and not server.alive:
                server.close()
                server = None
            if server is None:
                server = self.servers[requires] = _ForkServer(requires, self.environment)
        return server.start(request)

    def close(self) -> None:
        """End the servers, and with them every child that still runs."""
        for server in self.servers.values():
            server.close()


class _FreshInterpreter:
    def __init__(self, request: Request, environment: dict[str, str]) -> None:
        file = Path(request.folder, "request.json")
        file.write_text(json.dumps(asdict(request)), encoding="utf-8")
        with Path(request.folder, LOG_FILE).open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "bench.execution.child", str(file)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=environment,
                start_new_session=True,
            )
        self.pid = self.process.pid

    def wait(self, timeout: float | None) -> int | None:
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            return None


class _ForkedChild:
    """Fed by the server's messages: first the pid, then the exit code."""

    def __init__(self) -> None:
        self.messages: queue.SimpleQueue[int] = queue.SimpleQueue()
        self.pid = 0

    def wait_for_pid(self) -> None:
        try:
            self.pid = self.messages.get(timeout=START_TIMEOUT_S)
        except queue.Empty:
            raise LaunchError(f"the fork server did not answer within {START_TIMEOUT_S:g} s") from None
        if self.pid < 0:
            raise LaunchError(SERVER_GONE)

    def wait(self, timeout: float | None) -> int | None:
        try:
            return self.messages.get(timeout=timeout)
        except queue.Empty:
            return None


class _ForkServer:
    SERVER_DIED = -9

    def __init__(self, modules: tuple[str, ...], environment: dict[str, str]) -> None:
        self.socket, theirs = socket.socketpair()
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "bench.execution.server", str(theirs.fileno()), *modules],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=environment,
                start_new_session=True,  # so that Ctrl-C reaches the harness alone
            )
        self.alive = True
        self.lock = threading.Lock()
        self.children: dict[int, _ForkedChild] = {}
        self.count = 0
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def start(self, request: Request) -> _ForkedChild:
        child = _ForkedChild()
        with self.lock:
            if not self.alive:
                raise LaunchError(SERVER_GONE)
            self.count += 1
            self.children[self.count] = child
            message = {
                "id": self.count,
                "request": asdict(request),
                "log": str(Path(request.folder, LOG_FILE)),
            }
            with contextlib.suppress(BrokenPipeError):  # the reader tells the child that the server is gone
                self.socket.sendall(json.dumps(message).encode() + b"\n")
        child.wait_for_pid()
        return child

    def _read(self) -> None:
        # A server that dies with unread messages resets the connection instead of closing it.
        with self.socket.makefile("rb") as lines, contextlib.suppress(ConnectionResetError):
            for line in lines:
                message = json.loads(line)
                if "pid" in message:
                    self.children[message["id"]].messages.put(message["pid"])
                else:
                    self.children.pop(message["id"]).messages.put(message["exit"])
        with self.lock:
            self.alive = False
            for child in self.children.values():
                child.messages.put(self.SERVER_DIED)

    def close(self) -> None:
        with contextlib.suppress(OSError):  # the server may have gone first
            self.socket.shutdown(socket.SHUT_RDWR)
        self.process.wait()
        self.reader.join()
        self.socket.close()
