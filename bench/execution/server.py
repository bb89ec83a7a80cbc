"""A process that has imported what methods require, and forks one child for each job.

A fork saves every job the start of an interpreter and the import of its libraries. The standard library's
fork server is not used because it re-imports the caller's main script in every child.

Messages are lines of JSON on a socket pair. To the server: ``{"id", "request", "log"}``. From it:
``{"id", "pid"}`` when the child is there, ``{"id", "exit"}`` when it is gone. When the socket closes,
because the harness ended for whatever reason, the server kills what is left and goes.
"""

import contextlib
import gc
import importlib
import json
import os
import selectors
import signal
import socket
import sys
from typing import Any

PRELOADED = (
    "bench.execution.child",
    "scipy.linalg",
    "scipy.sparse.csgraph",
    "scipy.sparse.linalg",
    "threadpoolctl",
)


def main() -> None:
    """Serve on the file descriptor given first, with the modules named after it imported."""
    connection = socket.socket(fileno=int(sys.argv[1]))
    for name in [*PRELOADED, *sys.argv[2:]]:
        with contextlib.suppress(Exception):  # the child imports it again, and reports the error in its row
            importlib.import_module(name)
    if "numba" in sys.modules:
        _start_numba()
    gc.freeze()  # children share these pages instead of copying them at their first collection
    _Server(connection).serve()


def _start_numba() -> None:
    """Compile something: numba sets up its compiler at the first call, half a second that no child need spend again."""
    import numba

    numba.njit(lambda x: x + 1)(1)


class _Server:
    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.running: dict[int, int] = {}
        self.wakeup, write_end = os.pipe()
        os.set_blocking(self.wakeup, False)
        os.set_blocking(write_end, False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.set_wakeup_fd(write_end, warn_on_full_buffer=False)

    def serve(self) -> None:
        selector = selectors.DefaultSelector()
        selector.register(self.connection, selectors.EVENT_READ)
        selector.register(self.wakeup, selectors.EVENT_READ)
        pending = b""
        while True:
            ready = {key.fileobj for key, _ in selector.select()}
            if self.wakeup in ready:
                with contextlib.suppress(BlockingIOError):
                    os.read(self.wakeup, 4096)
                self._reap()
            if self.connection in ready:
                received = self.connection.recv(65536)
                if not received:
                    self._kill_all()
                    return
                *lines, pending = (pending + received).split(b"\n")
                for line in lines:
                    self._fork(json.loads(line))

    def _fork(self, message: dict[str, Any]) -> None:
        pid = os.fork()
        if pid == 0:
            self._be_the_child(message)
        self.running[pid] = message["id"]
        self._send({"id": message["id"], "pid": pid})

    def _be_the_child(self, message: dict[str, Any]) -> None:
        code = 1
        try:
            os.setsid()
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            self.connection.close()
            log = os.open(message["log"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
            os.dup2(log, 1)
            os.dup2(log, 2)
            from bench.execution import child

            child.run(child.Request(**message["request"]))
            sys.stdout.flush()
            sys.stderr.flush()
            code = 0
        finally:
            os._exit(code)

    def _reap(self) -> None:
        while self.running:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if pid == 0:
                return
            self._send({"id": self.running.pop(pid), "exit": os.waitstatus_to_exitcode(status)})

    def _send(self, message: dict[str, Any]) -> None:
        with contextlib.suppress(OSError):
            self.connection.sendall(json.dumps(message).encode() + b"\n")

    def _kill_all(self) -> None:
        for pid in self.running:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(pid, signal.SIGKILL)


if __name__ == "__main__":
    main()
