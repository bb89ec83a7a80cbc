"""The child of a job as a fresh interpreter, where the system cannot fork one."""

import contextlib
import json
import os
import subprocess
import sys
import threading
from dataclasses import asdict
from pathlib import Path

import psutil

from bench.execution.child import Request
from bench.execution.log import Tail
from bench.execution.processes import GRACE_S


class FreshInterpreter:
    """A `bench.execution.launch.Child`. Its standard input closes when this process dies, and then it ends too."""

    def __init__(self, request: Request, environment: dict[str, str]) -> None:
        file = Path(request.folder, "request.json")
        file.write_text(json.dumps(asdict(request)), encoding="utf-8")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "bench.execution.child", str(file)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment,
            start_new_session=True,
        )
        self.pid = self.process.pid
        self.log = ""
        self.tail = Tail()
        self.descendants: set[psutil.Process] = set()  # all that were ever seen; they know when a pid is another's
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        while printed := os.read(self.process.stdout.fileno(), 65536):
            self.tail.add(printed)

    def wait(self, timeout: float) -> int | None:
        """Exit code, or None when it still runs."""
        try:
            self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            self._look()
            return None
        self._clear()
        return self.process.returncode

    def end(self) -> None:
        """End it and what it started: TERM first, then KILL."""
        self._look()
        for process in (self.process, *self.descendants):
            with contextlib.suppress(psutil.NoSuchProcess):
                process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(GRACE_S)
        self.process.kill()
        self.process.wait()
        self._clear()

    def _look(self) -> None:
        with contextlib.suppress(psutil.NoSuchProcess):
            self.descendants.update(psutil.Process(self.pid).children(recursive=True))

    def _clear(self) -> None:
        """Kill what is left, and collect what was printed."""
        if hasattr(os, "killpg"):
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self.pid, 9)
        for process in self.descendants:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
        self.reader.join(GRACE_S)
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None and not self.reader.is_alive():
                pipe.close()
        self.log = self.tail.text
