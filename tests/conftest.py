"""Fixtures that several test files use."""

import os
import signal
from pathlib import Path

import pytest

# Before any numerical library is imported: the tests run on all cores already, one process each.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a command in the background: its children would not hear Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)


class Failures:
    """Prints what failed as it fails, under xdist too: a run takes minutes, and pytest itself tells at its end."""

    def __init__(self, terminal: pytest.TerminalReporter) -> None:
        self.terminal = terminal

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """One line for a failure: the test, where it failed, and the first line of why."""
        if report.failed:
            crash = getattr(report.longrepr, "reprcrash", None)
            why = f"{crash.path}:{crash.lineno}: {crash.message}" if crash else str(report.longrepr)
            self.terminal.ensure_newline()
            self.terminal.write_line(f"FAILED {report.nodeid} ({report.when}) {why.strip().splitlines()[0]}", red=True)


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Tell failures where there is a terminal, which the workers of xdist do not have."""
    if terminal := config.pluginmanager.get_plugin("terminalreporter"):
        config.pluginmanager.register(Failures(terminal))


LONGEST = ("test_readme.py", "test_docs.py")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes minutes in one test, lest one process be left with it at the end."""
    items.sort(key=lambda item: item.path.name not in LONGEST)


REAL_DATA = Path(__file__).parent.parent.parent / "shared" / "data"


@pytest.fixture
def real_data() -> Path:
    """Folder of the real scenes; the test is skipped where they are not on disk."""
    if not REAL_DATA.is_dir():
        pytest.skip("the real scenes are not on disk")
    return REAL_DATA


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No data but what a test names: no environment variable, and an empty download cache, which is returned."""
    monkeypatch.delenv("ROTSYNC_DATA_DIR", raising=False)
    monkeypatch.setattr("pooch.os_cache", lambda project: str(tmp_path / "cache" / project))
    return tmp_path / "cache" / "rotsync-bench"


@pytest.fixture
def faulty_plugin(tmp_path: Path) -> Path:
    """A plug-in file with a method that fails in the way it is told to, and a small seeded dataset."""
    path = tmp_path / "faulty.py"
    path.write_text(FAULTY, encoding="utf-8")
    return path


FAULTY = '''
"""A method that misbehaves on request."""
import os, signal, sys, time
from dataclasses import dataclass
from pathlib import Path
import numpy as np
from bench import Estimate, Instance, Problem, Skipped, Source, dataset, method, so3, stream


@method("faulty", title="Faulty", deterministic=False)
@dataclass(frozen=True)
class Faulty:
    """Identity rotations, or a fault."""
    fault: str = "fine"
    mark: str = ""

    def solve(self, problem, rng):
        if self.mark:
            with open(self.mark, "a") as file:
                file.write(f"{os.getpid()} {problem.n}\\n")
        identity = np.tile(np.eye(3), (problem.n, 1, 1))
        if self.fault == "segfault":
            os.kill(os.getpid(), signal.SIGSEGV)
        elif self.fault == "hang":
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            if os.fork() == 0:
                Path(self.mark).write_text(str(os.getpid()))
            time.sleep(1000)
        elif self.fault == "slow":
            time.sleep(0.3)
        elif self.fault == "gate":
            while problem.n > 4 and not Path(self.mark + ".open").exists():
                time.sleep(0.01)
        elif self.fault == "orphan":
            if os.fork() == 0:
                Path(self.mark).write_text(str(os.getpid()))
                time.sleep(1000)
            while not Path(self.mark).read_text().isdecimal():
                time.sleep(0.01)
        elif self.fault == "memory":
            kept = []
            while True:
                kept.append(np.ones(2_000_000))
        elif self.fault == "exit":
            os._exit(3)
        elif self.fault == "raise":
            raise KeyError("no such thing")
        elif self.fault == "skip":
            raise Skipped("not today")
        elif self.fault == "shape":
            return np.eye(3)
        elif self.fault == "all-nan":
            return np.full_like(identity, np.nan)
        elif self.fault == "some-nan":
            identity[0] = np.nan
        elif self.fault == "scaled":
            return 2 * identity
        elif self.fault == "reflected":
            return -identity
        elif self.fault == "one-inf":
            identity[1, 2, 2] = np.inf
        elif self.fault == "write":
            problem.rotations[0] = 0
        elif self.fault == "noisy":
            print("x" * 3_000_000)
        elif self.fault == "weights":
            return Estimate(identity, edge_weights=np.ones(1))
        elif self.fault == "timeless":
            return Estimate(identity, conversion_s=1e6)
        elif self.fault == "random":
            return so3.random(rng, problem.n)
        return identity


@dataset("toy", title="Toy")
@dataclass(frozen=True)
class Toy:
    """Complete noise-free graphs."""
    n: int = 5

    def sources(self, data_dir, seed):
        def load():
            truth = so3.random(stream(seed, "data", "toy"), self.n)
            i, j = np.triu_indices(self.n, k=1)
            problem = Problem(self.n, np.stack([i, j], axis=1), truth[i] @ np.swapaxes(truth[j], -1, -2))
            return Instance(problem, truth, f"toy{self.n}", revision=f"{self.n}-{seed}")

        yield Source(f"toy{self.n}", f"{self.n}-{seed}", load, seeded=True)
'''
