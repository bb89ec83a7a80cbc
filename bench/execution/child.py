"""What happens inside the process that runs a method.

The process is given the problem, never the truth: a request names the file of the problem, the method and
the folder for its two results, ``estimate.npz`` and ``result.json`` (written last); before it solves, it puts the empty
file ``begun`` there.
"""

import contextlib
import copy
import dataclasses
import errno
import functools
import importlib
import json
import os
import signal
import sys
import threading
import time
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.core import outcome
from bench.core.errors import described
from bench.core.outcome import Outcome
from bench.core.problem import Estimate, Information, Problem, Skipped
from bench.core.seeds import stream
from bench.execution.given import Given
from bench.execution.output import BEGUN_FILE, ESTIMATE_FILE, RESULT_FILE, Result
from bench.execution.threads import pin_threads
from bench.execution.validate import kept_warnings, reported, what_is_wrong
from bench.plugins.catalog import method_at
from bench.plugins.declare import Method, MethodInfo
from bench.storage.arrays import load_problem, save_estimate
from bench.storage.record import Report

MANY = 10  # times repeat_s; a solution that takes longer is timed as it is, the first time


@dataclass(frozen=True)
class Request:
    """One job, as the child is told of it.

    Parameters
    ----------
    problem
        Path of an ``.npz`` written by `bench.storage.arrays.save_problem`.
    origin, method, parameters
        Module (or file) of the plug-in, its name, and the parameters given.
    seed
        Seed of the run; the method gets the stream ``("method", name)`` of it.
    threads
        How many threads the numerical libraries may use.
    folder
        Where the results go.
    use
        What the method may use of what came with the measurements; None for all.
    core
        The one core that the process may use; None for all.
    repeat_s
        Of a timing run: the solution is computed again, for its time alone, until so many seconds went by;
        one that takes many times longer counts as it is. Zero for no timing.
    warm_up
        Whether the method compiles and loads before the clock starts.
    """

    problem: str
    origin: str
    method: str
    parameters: dict[str, Any]
    seed: int
    threads: int
    folder: str
    use: tuple[Information, ...] | None = None
    core: int | None = None
    repeat_s: float = 0.0
    warm_up: bool = True


@dataclass(frozen=True)
class Prepared:
    """What a job needs besides what it is told: the plug-in, the configured method and the problem."""

    info: MethodInfo
    method: Method
    problem: Problem


def prepare(request: Request) -> Prepared:
    """Import the plug-in, configure the method and load the problem."""
    info = method_at(request.origin, request.method)
    if info is None:
        raise LookupError(f"{request.origin} has no method '{request.method}'")
    return Prepared(info, info.configure(request.parameters), _loaded(request.problem))


@functools.lru_cache(maxsize=1)
def _loaded(path: str) -> Problem:
    """Load a problem; the last one is kept, since the jobs of one instance follow each other."""
    return load_problem(Path(path))


def run(request: Request, prepared: Prepared | None = None) -> None:
    """Run the job and write its results; whatever happens in Python becomes an outcome.

    Parameters
    ----------
    prepared
        What `prepare` gave for this request, where that was called before.
    """
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = solve(request, prepared or prepare(request))
        warned = kept_warnings(caught)
        result = dataclasses.replace(result, report=dataclasses.replace(result.report, warnings=warned))
    except Skipped as skip:
        result = Result(Outcome(outcome.SKIPPED, str(skip)), Report())
    except MemoryError as error:
        result = Result(Outcome(outcome.OUT_OF_MEMORY, str(error)), Report())
    except Exception as error:
        traceback.print_exc()
        result = Result(Outcome(outcome.ERROR, described(error)), Report())
    temporary = Path(request.folder, RESULT_FILE + ".part")
    temporary.write_text(json.dumps(dataclasses.asdict(result)), encoding="utf-8")
    temporary.replace(Path(request.folder, RESULT_FILE))


def solve(request: Request, prepared: Prepared) -> Result:
    """Run the job and write its estimate; whatever the method raises comes through."""
    info, method, problem = prepared.info, prepared.method, prepared.problem
    given = Given.of(problem, info, method, request.use, request.seed)
    for name in info.requires_of(request.parameters):
        importlib.import_module(name)
    report = Report(threads=pin_threads(request.threads), core=_pin_core(request.core))
    if request.warm_up and hasattr(method, "warm_up"):
        method.warm_up()
    with contextlib.suppress(OSError):
        Path(request.folder, BEGUN_FILE).touch()

    used = tuple(sorted(given.problem.carries))
    pristine = copy.copy(given.problem)  # what a solution caches in its problem, the next one must not find
    memory = _PeakMemory()
    processor = time.process_time()
    process = os.getpid()
    estimate, elapsed = _timed(method, given.problem, stream(request.seed, "method", info.name))
    if os.getpid() != process:
        os._exit(0)  # the method forked, and did not keep the other from returning here
    processor = time.process_time() - processor
    report = dataclasses.replace(report, peak_mib=memory.peak_mib(), solve_s=elapsed, used=used)
    wrong = what_is_wrong(pristine, estimate, elapsed)
    if wrong:
        return Result(Outcome(outcome.INVALID_OUTPUT, wrong), report)
    conversion_s = float(estimate.conversion_s)
    solve_s = elapsed - conversion_s
    report = dataclasses.replace(report, solve_s=solve_s, conversion_s=conversion_s)
    estimate = given.restored(estimate)
    if request.repeat_s:
        solves_s, waited = [solve_s], 1 - processor / elapsed
        if elapsed < MANY * request.repeat_s:
            solves_s, waited = _repeated(method, pristine, request, info.name)
        report = dataclasses.replace(report, solves_s=tuple(solves_s), waited=max(0.0, waited))
    report = reported(report, estimate)
    return _saved(estimate, Path(request.folder, ESTIMATE_FILE), report)


def _saved(estimate: Estimate, path: Path, report: Report) -> Result:
    """Keep the estimate; a full disk is told as such, since it is no fault of the method."""
    try:
        save_estimate(path, estimate)
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        path.unlink(missing_ok=True)
        return Result(Outcome(outcome.ERROR, str(error)), report, disk_full=error.strerror or str(error))
    return Result(Outcome(outcome.OK), report)


def _timed(method: Method, problem: Problem, rng: np.random.Generator) -> tuple[Estimate, float]:
    if hasattr(os, "sched_yield"):
        os.sched_yield()  # whoever waits for this core has his turn now, and not in the middle of a short solution
    start = time.perf_counter()
    answer = method.solve(problem, rng)
    elapsed = time.perf_counter() - start
    return answer if isinstance(answer, Estimate) else Estimate(answer), elapsed


def _repeated(method: Method, problem: Problem, request: Request, name: str) -> tuple[list[float], float]:
    """Solve seconds of as many solutions as fit into `repeat_s`, at least one, and the share of time off the core.

    The solution before these has filled caches and done what libraries put off to their first call. What lies between
    two solutions counts for the end: it takes longer than the quickest ones.
    """
    solves_s: list[float] = []
    total = processor = 0.0
    end = time.perf_counter() + request.repeat_s
    while not solves_s or time.perf_counter() < end:
        before = time.process_time()
        estimate, elapsed = _timed(method, copy.copy(problem), stream(request.seed, "method", name))
        processor += time.process_time() - before
        total += elapsed
        solves_s.append(elapsed - estimate.conversion_s)
    return solves_s, 1 - processor / total


def _pin_core(core: int | None) -> int | None:
    """Pin this process to a core where the system can; the core, or None."""
    if core is None or not hasattr(os, "sched_setaffinity"):
        return None
    os.sched_setaffinity(0, {core})
    return core


class _PeakMemory:
    """Resident memory that is added between now and the peak.

    Linux can reset the peak that it remembers; elsewhere the peak of the whole process counts.
    """

    def __init__(self) -> None:
        try:
            with open("/proc/self/clear_refs", "wb", buffering=0) as file:
                file.write(b"5")
        except OSError:
            self._before = _peak_mib()
        else:
            self._before = _status_mib(b"VmRSS")

    def peak_mib(self) -> float:
        return max(_peak_mib() - self._before, 0.0)


def _peak_mib() -> float:
    try:
        return _status_mib(b"VmHWM")
    except OSError:
        import psutil

        memory = psutil.Process().memory_info()
        return getattr(memory, "peak_wset", memory.rss) / 2**20


def _status_mib(field: bytes) -> float:
    with open("/proc/self/status", "rb") as file:
        _, found, rest = file.read().partition(field + b":")
    if not found:
        raise OSError(f"/proc/self/status has no {field.decode()}")
    return int(rest.split(None, 1)[0]) / 1024


def main() -> None:
    """Run the request in the file given as the only argument: the way without a fork server."""
    harness = os.dup(0)
    threading.Thread(target=_end_after, args=(harness,), daemon=True).start()
    run(Request(**json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))))
    sys.stdout.flush()
    os._exit(0)


def _end_after(harness: int) -> None:
    """End this process, and all of its group, when the harness that holds the other end of this pipe is gone."""
    os.read(harness, 1)
    if hasattr(os, "killpg"):
        os.killpg(os.getpgid(0), signal.SIGKILL)
    os._exit(1)


if __name__ == "__main__":
    main()
