"""Warming up in the fork server: what methods compile and load is then there in every child."""

import contextlib
import gc
import json
import signal
import warnings
from collections.abc import Iterator
from types import FrameType
from typing import TYPE_CHECKING, Any

from bench.execution import threads

if TYPE_CHECKING:
    from bench.execution import child

FORKABLE = {"numba", "scipy"}  # libraries that come through a fork whatever was called before
LIMIT_S = 1.0  # the server does nothing else meanwhile


class Warmth:
    """What has been warmed up in this process.

    Each kernel that numba has compiled takes a few milliseconds to read from its cache, in every child anew. So a
    configuration is warmed up here once a job of it has ended well: what its child came through, the server does.
    Not where it requires more than numba and scipy, since the threads of other libraries do not survive a fork.
    Children warm up all the same: what is left of it are the pages that they touch first, and the clock should not
    tell of these.
    """

    def __init__(self) -> None:
        self._proven: set[str] = set()
        self._tried: set[str] = set()

    def prove(self, request: dict[str, Any]) -> None:
        """A job has ended well."""
        self._proven.add(_configuration(request))

    def warm_up(self, request: dict[str, Any], prepared: "child.Prepared") -> None:
        """Warm up for a job that is about to be forked, where that is due; faults are left for the child to tell."""
        configuration = _configuration(request)
        if configuration not in self._proven or configuration in self._tried:
            return
        self._tried.add(configuration)
        method = prepared.method
        if hasattr(method, "warm_up") and FORKABLE.issuperset(prepared.info.requires_of(request["parameters"])):
            with contextlib.suppress(Exception), warnings.catch_warnings(action="ignore"), _limited():
                method.warm_up()
            threads.find_libraries()
            gc.freeze()


def _configuration(request: dict[str, Any]) -> str:
    return json.dumps([request["origin"], request["method"], request["parameters"]], sort_keys=True)


@contextlib.contextmanager
def _limited() -> Iterator[None]:
    """Raise TimeoutError where the block takes longer than `LIMIT_S`, again and again where it goes on nevertheless."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise TimeoutError

    signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, LIMIT_S, LIMIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
