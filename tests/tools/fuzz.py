"""Fuzz the parsers: ``python tests/tools/fuzz.py --parser g2o --inputs 100000``.

Where atheris is installed, inputs are chosen by the code that they reach; otherwise, or with ``--engine chance``, they
are damaged files as in the tests. Every input must be read, or refused with `InputError` in one line that names the
file: no other exception, at most some seconds, no growth of memory. What fails is kept, made small, in
``tests/corpus/<parser>``, which the tests replay.
"""

import argparse
import contextlib
import gc
import hashlib
import importlib.util
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from types import FrameType

TESTS = Path(__file__).parent.parent
sys.path[:0] = [str(TESTS), str(TESTS.parent)]

CORPUS = TESTS / "corpus"
SECONDS = 20.0  # of one input; much, for a machine may be busy
GROWTH_MIB = 64.0  # of the process, after its warm-up
PEAK_MIB = 512.0  # of one input
WARM_UP = 2000


class HangError(BaseException):
    """Raised in an input that takes too long; no parser catches it."""


class Watch:
    """Feeds one parser, and keeps what fails."""

    def __init__(self, name: str, inputs: int, seed: int = 0) -> None:
        from parsers import PARSERS

        self.name, self.inputs = name, inputs
        self.parser = PARSERS[name]
        self.rng = random.Random(seed)
        self.failures: dict[str, bytes] = {}
        self.fed = self.refused = 0
        self.was_refused = False
        self.slowest = self.rss = 0.0
        self.start = time.monotonic()
        memory = "/dev/shm" if Path("/dev/shm").is_dir() else None
        self._temporary = tempfile.TemporaryDirectory(prefix="fuzz-", dir=memory)
        self.folder = Path(self._temporary.name)
        signal.signal(signal.SIGALRM, _hang)

    @property
    def growth(self) -> float:
        """MiB by which the process has grown since its warm-up."""
        gc.collect()
        return _rss_mib() - self.rss

    def damaged(self, *others: bytes) -> bytes:
        """A damaged copy of one of the parser's files, or of others."""
        from damage import damaged

        return damaged(others or self.parser.seeds, self.parser.container, self.rng)

    def feed(self, data: bytes) -> None:
        """Read one input; whatever it does that it must not is kept."""
        peak, begin = _peak_mib(), time.perf_counter()
        signal.setitimer(signal.ITIMER_REAL, SECONDS)
        try:
            failure = self._read(data)
            self.refused += self.was_refused
        except HangError as error:
            failure = _signature(error)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
        self.slowest = max(self.slowest, time.perf_counter() - begin)
        if _peak_mib() - peak > PEAK_MIB:
            failure = failure or f"memory: {_peak_mib() - peak:.0f} MiB"
        if failure and failure not in self.failures:
            self.failures[failure] = data
            self._keep(failure, self._smaller(failure, data))
        self.fed += 1
        if self.fed == WARM_UP:
            gc.collect()
            self.rss = _rss_mib()

    def _read(self, data: bytes) -> str:
        from parsers import complaint

        from bench.core.errors import InputError

        self.was_refused = False
        try:
            self.parser.read(data, self.folder)
        except InputError as error:
            self.was_refused = True
            return complaint(str(error), str(self.folder) if self.parser.names_file else "")
        except HangError:
            raise
        except BaseException as error:
            return _signature(error)
        return ""

    def _smaller(self, failure: str, data: bytes) -> bytes:
        """The input without what the failure does not need."""
        if self.parser.container != "plain" or failure.startswith(("Hang", "memory")):
            return data
        part = len(data) // 2
        while part:
            start = 0
            while start < len(data):
                shorter = data[:start] + data[start + part :]
                if self._read(shorter) == failure:
                    data = shorter
                else:
                    start += part
            part //= 2
        return data

    def _keep(self, failure: str, data: bytes) -> None:
        folder = CORPUS / self.name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)
        print(f"{self.name}: input {self.fed}, {len(data)} bytes: {failure}", flush=True)

    def close(self) -> bool:
        """Print one line of what was found, and remove the folder of the inputs; whether all was well."""
        growth = self.growth if self.fed > WARM_UP else 0.0
        print(
            f"{self.name:<14} {self.fed} inputs, {self.refused} refused, {time.monotonic() - self.start:.0f} s, "
            f"slowest {self.slowest:.2f} s, memory {growth:+.1f} MiB, {len(self.failures)} failures",
            flush=True,
        )
        self._temporary.cleanup()
        return not self.failures and growth <= GROWTH_MIB


def _signature(error: BaseException) -> str:
    """Type of an exception and where the project raised it, so that each fault is kept once."""
    trace, place = error.__traceback__, ""
    while trace is not None:
        file = Path(trace.tb_frame.f_code.co_filename)
        if file.is_relative_to(TESTS.parent) and not file.is_relative_to(TESTS):
            place = f"{file.name}:{trace.tb_lineno}"
        trace = trace.tb_next
    return f"{type(error).__name__} at {place or str(error)[:100]}"


def _hang(number: int, frame: FrameType | None) -> None:
    raise HangError(f"more than {SECONDS:g} s")


def _rss_mib() -> float:
    import psutil

    return psutil.Process().memory_info().rss / 2**20


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _limit_memory() -> None:
    """Let this process have little more address space than it has, so that nothing can claim much unnoticed."""
    import psutil

    most = psutil.Process().memory_info().vms + int(4 * PEAK_MIB * 2**20)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def by_chance(watch: Watch) -> None:
    """Feed damaged files."""
    while watch.fed < watch.inputs:
        watch.feed(watch.damaged())


def by_coverage(watch: Watch) -> None:
    """Feed what libFuzzer makes of the seeds, of our own damage and of what reached new code; does not return."""
    import atheris

    def one(data: bytes) -> None:
        watch.feed(data)
        if watch.fed >= watch.inputs:
            _finish(watch)

    def mutator(data: bytes, most: int, seed: int) -> bytes:
        watch.rng.seed(seed)
        chance = watch.rng.random()
        if watch.parser.container == "plain" and chance < 0.25:
            return atheris.Mutate(data, most)[:most]
        if chance < 0.6:
            with contextlib.suppress(Exception):  # what is not packed as it should be cannot be damaged inside
                return watch.damaged(data)[:most]
        return watch.damaged()[:most]  # what reached new code is often broken beyond recognition

    with tempfile.TemporaryDirectory(prefix="seeds-") as folder:
        kept = [path.read_bytes() for path in (CORPUS / watch.name).glob("*")]
        for k, data in enumerate([*watch.parser.seeds, *kept]):
            Path(folder, f"seed{k}").write_bytes(data)
        # what is slow or too large is ours to judge, and nothing is written where the user stands
        options = ["-max_len=20000", "-verbosity=0", "-rss_limit_mb=0", f"-artifact_prefix={folder}/"]
        atheris.Setup(["fuzz", folder, *options], one, custom_mutator=mutator)
        atheris.Fuzz()


def _finish(watch: Watch) -> None:
    """Print the report and end the process, for libFuzzer has no other end."""
    well = watch.close()
    sys.stdout.flush()
    os._exit(0 if well else 1)


def _fuzz_one(name: str, inputs: int, engine: str, seed: int) -> None:
    """Fuzz one parser in this process; does not return."""
    sys.dont_write_bytecode = True
    warnings.simplefilter("ignore")
    with contextlib.ExitStack() as instrumented:
        if engine == "coverage":
            import atheris

            instrumented.enter_context(atheris.instrument_imports(include=["bench"]))
        watch = Watch(name, inputs, seed)
    _limit_memory()
    (by_coverage if engine == "coverage" else by_chance)(watch)
    _finish(watch)


def main() -> int:
    """Fuzz the parsers that were named, each in a process of its own; 1 where one failed."""
    parse = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parse.add_argument("--parser", action="append", help="default: all")
    parse.add_argument("--inputs", type=int, default=100_000)
    default = "coverage" if importlib.util.find_spec("atheris") else "chance"
    parse.add_argument("--engine", choices=("coverage", "chance"), default=default)
    parse.add_argument("--seed", type=int, default=0)
    parse.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    given = parse.parse_args()
    if given.here:
        _fuzz_one(given.parser[0], given.inputs, given.engine, given.seed)
    from parsers import PARSERS

    failed = 0
    for name in given.parser or PARSERS:
        command = [sys.executable, __file__, "--here", "--parser", name, "--inputs", str(given.inputs)]
        command += ["--engine", given.engine, "--seed", str(given.seed)]
        ended = subprocess.run(command, check=False, stderr=subprocess.PIPE, text=True, errors="replace")
        if ended.returncode not in (0, 1):
            print(f"{name}: the fuzzer itself failed\n{ended.stderr[-3000:]}")
        failed |= ended.returncode != 0
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
