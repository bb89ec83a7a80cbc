"""Fuzz the parsers: ``python tests/fuzz.py --parser g2o --inputs 100000``.

Where atheris is installed, inputs are chosen by the code that they reach; otherwise, or with ``--engine mutation``, by
chance from damaged files. Every input must be read, or refused with `InputError` in one line that names the file:
no other exception, at most some seconds, no growth of memory. What fails is kept, made small, in
``tests/corpus/<parser>``, which the tests replay.
"""

import argparse
import contextlib
import gc
import hashlib
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

CORPUS = Path(__file__).parent / "corpus"
INPUTS = 100_000
SECONDS = 20.0  # of one input; much, for a machine may be busy
GROWTH_MIB = 64.0  # of the process, after its warm-up
PEAK_MIB = 512.0  # of one input
WARM_UP = 2000


class HangError(BaseException):
    """Raised in an input that takes too long; no parser catches it."""


class Watch:
    """Feeds one parser, and keeps what fails."""

    def __init__(self, name: str, inputs: int, seed: int) -> None:
        from parsers import PARSERS

        self.name, self.inputs = name, inputs
        self.parser = PARSERS[name]
        self.rng = random.Random(seed)
        self.failures: dict[str, bytes] = {}
        self.fed = self.refused = 0
        self.was_refused = False
        self.slowest = self.rss = 0.0
        self.start = time.monotonic()
        self._temporary = tempfile.TemporaryDirectory(
            prefix="fuzz-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None
        )
        self.folder = Path(self._temporary.name)
        signal.signal(signal.SIGALRM, _hang)

    @property
    def growth(self) -> float:
        """MiB by which the process has grown since its warm-up."""
        gc.collect()
        return _rss_mib() - self.rss

    def limit_memory(self) -> None:
        """Let this process have little more address space than it has, so that nothing can claim much unnoticed."""
        import psutil

        most = psutil.Process().memory_info().vms + int(4 * PEAK_MIB * 2**20)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))

    def mutated(self) -> bytes:
        """A damaged copy of one of the seeds."""
        from mutation import mutated

        return mutated(
            self.rng.choice(self.parser.seeds), self.rng.choice(self.parser.seeds), self.parser.container, self.rng
        )

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

    def close(self) -> None:
        """Remove the folder of the inputs."""
        self._temporary.cleanup()

    def report(self) -> str:
        """One line: inputs, refusals, seconds, memory, failures."""
        seconds = time.monotonic() - self.start
        return (
            f"{self.name:<14} {self.fed} inputs, {self.refused} refused, {seconds:.0f} s, "
            f"slowest {self.slowest:.2f} s, memory {self.growth:+.1f} MiB, {len(self.failures)} failures"
        )


def complaint(message: str, file: str) -> str:
    """What is wrong with a refusal, or nothing."""
    if "\n" in message or len(message) > 3000:
        return f"the message is not one line: {message[:30]!r}"
    return "" if file in message else f"the message does not name the file: {message[:30]!r}"


def _signature(error: BaseException) -> str:
    """Type of an exception and where it was raised, so that each fault is kept once."""
    trace = error.__traceback__
    place = ""
    while trace is not None:
        file = Path(trace.tb_frame.f_code.co_filename)
        if file.parent.name in ("bench", "formats", "papers", "execution", "datasets", "methods"):
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


def by_mutation(watch: Watch) -> None:
    """Feed damaged copies of the seeds."""
    while watch.fed < watch.inputs:
        watch.feed(watch.mutated())


def by_coverage(watch: Watch) -> None:
    """Feed what libFuzzer makes of the seeds, of our own damage and of what reached new code; does not return."""
    import atheris
    from mutation import mutated

    def one(data: bytes) -> None:
        watch.feed(data)
        if watch.fed >= watch.inputs:
            _finish(watch)

    def mutator(data: bytes, most: int, seed: int) -> bytes:
        rng = random.Random(seed)
        if rng.random() < 0.4:  # what reached new code is often broken beyond recognition
            return watch.mutated()[:most]
        if watch.parser.container == "plain" and rng.random() < 0.4:
            return atheris.Mutate(data, most)[:most]
        with contextlib.suppress(Exception):  # what is not packed as it should be cannot be damaged inside
            return mutated(data, rng.choice(watch.parser.seeds), watch.parser.container, rng)[:most]
        return watch.mutated()[:most]

    with _seed_folder(watch) as folder:
        arguments = [
            "fuzz",
            str(folder),
            "-max_len=20000",
            "-verbosity=0",
            "-rss_limit_mb=0",
        ]
        atheris.Setup(arguments, one, custom_mutator=mutator)
        atheris.Fuzz()


@contextlib.contextmanager
def _seed_folder(watch: Watch) -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="seeds-") as name:
        for k, data in enumerate(watch.parser.seeds):
            Path(name, f"seed{k}").write_bytes(data)
        for path in sorted((CORPUS / watch.name).glob("*")):
            Path(name, path.name).write_bytes(path.read_bytes())
        yield Path(name)


def _finish(watch: Watch) -> None:
    """Print the report and end the process, for libFuzzer has no other end."""
    failed = bool(watch.failures) or watch.growth > GROWTH_MIB
    print(watch.report(), flush=True)
    watch.close()
    sys.stdout.flush()
    os._exit(1 if failed else 0)


def _fuzz_one(name: str, inputs: int, engine: str, seed: int) -> None:
    """Fuzz one parser in this process; does not return."""
    sys.dont_write_bytecode = True
    warnings.simplefilter("ignore")
    if engine == "coverage":
        import atheris

        with atheris.instrument_imports(include=["bench"]):
            watch = Watch(name, inputs, seed)
        watch.limit_memory()
        by_coverage(watch)
    watch = Watch(name, inputs, seed)
    watch.limit_memory()
    by_mutation(watch)
    _finish(watch)


def _has_atheris() -> bool:
    import importlib.util

    return importlib.util.find_spec("atheris") is not None


def main() -> int:
    """Fuzz the parsers that were named, each in a process of its own; 1 where one failed."""
    parse = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parse.add_argument("--parser", action="append", help="default: all")
    parse.add_argument("--inputs", type=int, default=INPUTS)
    parse.add_argument(
        "--engine", choices=("coverage", "mutation"), default="coverage" if _has_atheris() else "mutation"
    )
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
