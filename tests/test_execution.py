"""Supervised execution: however a method ends, its row says so, and nothing is left behind."""

import os
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from bench.core.limits import Limits
from bench.core.problem import Problem
from bench.execution import launch
from bench.execution.single import Answer, SingleSolver
from bench.plugins.catalog import catalog

LIMITS = Limits(seconds=30, memory_gib=1.0)


def solve(plugin: Path, fault: str, limits: Limits = LIMITS, mark: str = "", seed: int = 0) -> Answer:
    info = catalog("method", [plugin])["faulty"]
    with SingleSolver(info, {"fault": fault, "mark": mark}, limits) as solver:
        return solver.solve(triangle(), seed)


def triangle() -> Problem:
    return Problem(3, np.array([(0, 1), (0, 2), (1, 2)]), np.tile(np.eye(3), (3, 1, 1)))


@pytest.mark.parametrize(
    ("fault", "status"),
    [
        ("fine", "ok"),
        ("some-nan", "ok"),
        ("noisy", "ok"),
        ("segfault", "crashed(SIGSEGV)"),
        ("exit", "crashed(exit code 3)"),
        ("raise", "error(KeyError: 'no such thing')"),
        ("skip", "skipped(not today)"),
        ("write", "error(ValueError: assignment destination is read-only)"),
        ("shape", "invalid-output(rotations must be an array of shape (3, 3, 3), not (3, 3))"),
        ("all-nan", "invalid-output(no camera was solved)"),
        ("one-inf", "invalid-output(1 camera has entries that are not finite)"),
        ("scaled", "invalid-output(3 of 3 matrices are not rotations to 1e-06)"),
        ("reflected", "invalid-output(3 of 3 matrices are not rotations to 1e-06)"),
        ("timeless", "invalid-output(conversion_s is 1e+06 s, which is not within the time that solve took)"),
        ("weights", "invalid-output(edge_weights must have shape (3,), not (1,))"),
    ],
)
def test_every_ending_has_its_row(faulty_plugin: Path, fault: str, status: str) -> None:
    answer = solve(faulty_plugin, fault)
    assert answer.outcome.text == status
    assert (answer.estimate is not None) == (status == "ok")


def test_output_of_a_failed_child_is_kept(faulty_plugin: Path) -> None:
    log = solve(faulty_plugin, "raise").log
    assert "no such thing" in log
    assert "Traceback" in log


def is_running(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def test_timeout_ends_a_child_that_ignores_term_and_its_grandchild(faulty_plugin: Path, tmp_path: Path) -> None:
    mark = tmp_path / "grandchild"
    ended = solve(faulty_plugin, "hang", Limits(seconds=1.5, memory_gib=1), str(mark)).outcome
    assert ended.text == "timeout(1.5 s)"
    assert not is_running(int(mark.read_text()))


def test_a_grandchild_does_not_outlive_a_child_that_ended_well(faulty_plugin: Path, tmp_path: Path) -> None:
    mark = tmp_path / "grandchild"
    ended = solve(faulty_plugin, "orphan", mark=str(mark)).outcome
    assert ended.text == "ok"
    deadline = time.monotonic() + 5
    while is_running(int(mark.read_text())) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not is_running(int(mark.read_text()))


def test_memory_limit_is_on_resident_memory(faulty_plugin: Path) -> None:
    ended = solve(faulty_plugin, "memory", Limits(seconds=60, memory_gib=0.6)).outcome
    assert ended.text == "out-of-memory(0.6 GiB)"


def test_threads_are_pinned_in_the_child(faulty_plugin: Path) -> None:
    assert solve(faulty_plugin, "fine").report.threads == 1


def test_random_numbers_come_from_the_seed(faulty_plugin: Path) -> None:
    first, again, other = (solve(faulty_plugin, "random", seed=seed).estimate for seed in (1, 1, 2))
    assert first is not None
    assert again is not None
    assert other is not None
    np.testing.assert_array_equal(first.rotations, again.rotations)
    assert not np.array_equal(first.rotations, other.rotations)


def test_without_fork_a_fresh_interpreter_does_the_same(faulty_plugin: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(launch, "CAN_FORK", False)
    assert solve(faulty_plugin, "fine").outcome.text == "ok"
    assert solve(faulty_plugin, "segfault").outcome.text == "crashed(SIGSEGV)"


SLOW_TO_COMPILE = """
import time
from dataclasses import dataclass
import numpy as np
from bench import method


@method("slow-to-compile", title="Slow to compile")
@dataclass(frozen=True)
class SlowToCompile:
    solve_s: float = 0.0

    def warm_up(self):
        time.sleep(1.5)

    def solve(self, problem, rng):
        time.sleep(self.solve_s)
        return np.tile(np.eye(3), (problem.n, 1, 1))
"""


@pytest.mark.parametrize(
    "forks", [pytest.param(True, marks=pytest.mark.skipif(not launch.CAN_FORK, reason="there is no fork here")), False]
)
def test_the_clock_starts_once_the_method_is_compiled(
    tmp_path: Path, forks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(launch, "CAN_FORK", forks)
    (tmp_path / "slow.py").write_text(SLOW_TO_COMPILE)
    info = catalog("method", [tmp_path / "slow.py"])["slow-to-compile"]
    for solve_s, text in ((0.0, "ok"), (30.0, "timeout(1 s)")):
        with SingleSolver(info, {"solve_s": solve_s}, Limits(1.0, memory_gib=1.0)) as solver:
            assert solver.solve(triangle()).outcome.text == text


WARM = '''
"""Tells which processes warm up and which solve; something may be wrong with the second that warms up."""
import os, time
from dataclasses import dataclass
from pathlib import Path
import numpy as np
from bench import method


@method("warm", title="Warm", requires=REQUIRES)
@dataclass(frozen=True)
class Warm:
    mark: str = ""
    fault: str = ""

    def tell(self, what):
        with open(self.mark, "a") as file:
            file.write(f"{what} {os.getpid()}\\n")

    def warm_up(self):
        self.tell("warm")
        if Path(self.mark).read_text().count("warm") == 2:
            time.sleep(1000 if self.fault == "endless" else 0)
            assert self.fault != "raises"

    def solve(self, problem, rng):
        self.tell("solve")
        return np.tile(np.eye(3), (problem.n, 1, 1))
'''


def warmed(folder: Path, requires: tuple[str, ...], fault: str = "") -> tuple[list[str], set[str]]:
    """What was done for three jobs, one after another, and the processes that warmed up but solved nothing."""
    plugin, mark = folder / "warm.py", folder / "mark"
    plugin.write_text(WARM.replace("REQUIRES", repr(requires)))
    with SingleSolver(catalog("method", [plugin])["warm"], {"mark": str(mark), "fault": fault}, LIMITS) as solver:
        for _ in range(3):
            solver._warm_up = True
            assert solver.solve(triangle()).outcome.text == "ok"
    done = [line.split() for line in mark.read_text().splitlines()]
    processes = {what: {process for did, process in done if did == what} for what in ("warm", "solve")}
    return [what for what, _ in done], processes["warm"] - processes["solve"]


@pytest.mark.skipif(not launch.CAN_FORK, reason="there is no fork here")
@pytest.mark.parametrize("fault", ["", "endless", "raises"])
def test_the_server_warms_up_once_after_the_first_job(tmp_path: Path, fault: str) -> None:
    did, servers = warmed(tmp_path, ("scipy",), fault)
    assert did == ["warm", "solve", "warm", "warm", "solve", "warm", "solve"]
    assert len(servers) == 1


def test_the_server_does_not_warm_up_what_may_start_threads(tmp_path: Path) -> None:
    did, servers = warmed(tmp_path, ("scipy", "pandas"))
    assert did == 3 * ["warm", "solve"]
    assert servers == set()


def test_a_server_that_dies_is_replaced(faulty_plugin: Path) -> None:
    info = catalog("method", [faulty_plugin])["faulty"]
    problem = Problem(2, np.array([(0, 1)]), np.eye(3)[None])
    with SingleSolver(info, {}, LIMITS) as solver:
        assert solver.solve(problem).outcome.text == "ok"
        server = solver.launcher.servers[frozenset()]
        os.kill(server.process.pid, 9)
        server.reader.join(timeout=10)
        assert solver.solve(problem).outcome.text == "ok"


def test_a_disconnected_graph_is_solved_on_its_largest_component(faulty_plugin: Path) -> None:
    info = catalog("method", [faulty_plugin])["faulty"]
    problem = Problem(5, np.array([(0, 1), (2, 3), (2, 4)]), np.tile(np.eye(3), (3, 1, 1)))
    with SingleSolver(info, {}, LIMITS) as solver:
        answer = solver.solve(problem)
    assert answer.estimate is not None
    assert np.isnan(answer.estimate.rotations[:2]).all()
    assert np.isfinite(answer.estimate.rotations[2:]).all()
    assert answer.report.notes == ("disconnected graph: solved on its largest component, 3 of 5 cameras",)


def test_a_requirement_that_kills_its_importer_costs_its_own_row(
    faulty_plugin: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "deadly_library.py").write_text("import os\nos.abort()\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    text = faulty_plugin.read_text().replace('title="Faulty"', 'title="Faulty", requires=("deadly_library",)')
    faulty_plugin.write_text(text)
    ended = solve(faulty_plugin, "fine").outcome
    assert ended.text == "crashed(the fork server died while importing what the method requires)"
