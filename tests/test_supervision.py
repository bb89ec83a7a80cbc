"""Supervision in detail: what is told of a job that ended badly, what is made of what it left, who ends whom."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.core import outcome
from bench.core.limits import Limits
from bench.core.problem import Estimate, Problem
from bench.execution import launch, processes, supervise
from bench.execution.output import LARGEST_RESULT, Result, UnusableError, read_output
from bench.execution.single import Answer, SingleSolver
from bench.plugins.catalog import catalog
from bench.storage.arrays import save_estimate
from bench.storage.record import Report

PLUGIN = Path(__file__).with_name("chaos_plugin.py")
TRIANGLE = Problem(3, np.array([(0, 1), (0, 2), (1, 2)]), np.tile(np.eye(3), (3, 1, 1)))


def solver(fault: str, seconds: float = 30) -> SingleSolver:
    info = catalog("method", [PLUGIN])["chaos"]
    return SingleSolver(info, {"fault": fault}, Limits(seconds, memory_gib=1.0))


def solve(fault: str, seconds: float = 30) -> Answer:
    with solver(fault, seconds) as alone:
        return alone.solve(TRIANGLE)


@pytest.fixture
def marks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Folder in which processes of a job leave their ids; in the end none of them may be there."""
    folder = tmp_path / "marks"
    folder.mkdir()
    monkeypatch.setenv("CHAOS_MARKS", str(folder))
    yield folder
    left = [psutil.Process(int(mark.name)) for mark in folder.iterdir() if psutil.pid_exists(int(mark.name))]
    _, left = psutil.wait_procs(left, timeout=10)
    assert not left


@pytest.fixture
def starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """File with one line for each time that the method was started."""
    monkeypatch.setenv("CHAOS_STARTS", str(tmp_path / "starts"))
    return tmp_path / "starts"


def test_a_crash_says_where() -> None:
    answer = solve("segfault")
    assert answer.outcome.text == "crashed(SIGSEGV)"
    assert "Segmentation fault" in answer.log
    assert "chaos_plugin.py" in answer.log


def test_what_a_job_printed_is_kept_where_it_ended_well_too() -> None:
    assert solve("chatter").log == "x" * 999 + "\n"
    assert solve("well").log == ""


def test_of_a_method_that_forks_one_process_answers() -> None:
    answer = solve("twins")
    assert answer.outcome.text == "ok"
    assert answer.estimate is not None


def test_a_kill_by_the_kernel_is_told_from_others(monkeypatch: pytest.MonkeyPatch) -> None:
    assert solve("killed").outcome.text == "crashed(SIGKILL, from outside the benchmark)"
    counts = iter(range(9))
    monkeypatch.setattr(outcome, "kernel_kills", lambda: next(counts))
    assert solve("killed").outcome.text == "out-of-memory(killed by the kernel: the machine has no more)"
    assert solve("segfault").outcome.text == "crashed(SIGSEGV)"


@pytest.mark.skipif(not launch.CAN_FORK, reason="this system has no fork server")
def test_a_job_that_loses_its_server_is_started_again(marks: Path, starts: Path) -> None:
    with solver("hang", seconds=4) as alone:
        answers: list[Answer] = []
        thread = threading.Thread(target=lambda: answers.append(alone.solve(TRIANGLE)))
        thread.start()
        while not list(marks.iterdir()):
            time.sleep(0.01)
        os.kill(alone.launcher.servers[frozenset()].process.pid, signal.SIGKILL)
        thread.join()
    assert answers[0].outcome.text == "timeout(4 s)"
    assert len(starts.read_text().splitlines()) == 2


@pytest.mark.skipif(not launch.CAN_FORK, reason="this system has no fork server")
def test_a_job_that_kills_its_server_is_started_twice_at_most(starts: Path) -> None:
    assert solve("kill_server").outcome.text == "crashed(the fork server died while the job was running)"
    assert len(starts.read_text().splitlines()) == 2


@pytest.mark.skipif(not launch.CAN_FORK, reason="this system has no fork server")
def test_an_import_that_hangs_costs_its_own_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slow_library.py").write_text("import time\ntime.sleep(1000)\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(launch, "IMPORT_LIMIT_S", 3)
    plugin = tmp_path / "plugin.py"
    plugin.write_text(PLUGIN.read_text().replace('title="Chaos"', 'title="Chaos", requires=("slow_library",)'))
    with SingleSolver(catalog("method", [plugin])["chaos"], {}, Limits(60, 1.0)) as alone:
        ended = alone.solve(TRIANGLE).outcome
    assert ended.text == "crashed(the fork server took more than 3 s while importing what the method requires)"


@pytest.mark.parametrize(
    ("fault", "status"),
    [("hang", "timeout(6 s)"), ("endless", "timeout(6 s)"), ("orphan", "ok"), ("garbage", "invalid-output")],
)
def test_a_fresh_interpreter_is_supervised_too(
    marks: Path, monkeypatch: pytest.MonkeyPatch, fault: str, status: str
) -> None:
    monkeypatch.setattr(launch, "CAN_FORK", False)
    answer = solve(fault, seconds=6 if status.startswith("timeout") else 30)
    assert answer.outcome.text.startswith(status)
    assert len(answer.log) == (4000 if fault == "endless" else 0)


def test_a_fresh_interpreter_ends_with_its_harness(marks: Path) -> None:
    script = f"""
import sys
sys.path.insert(0, {str(PLUGIN.parent)!r})
from bench.execution import launch
from test_supervision import solve
launch.CAN_FORK = False
solve("hang")
"""
    with subprocess.Popen([sys.executable, "-c", script]) as harness:
        while not list(marks.iterdir()):
            time.sleep(0.01)
        harness.kill()


class Growing:
    """A child that takes more memory from one look to the next."""

    pid = 0
    log = ""

    def __init__(self) -> None:
        self.pauses: list[float] = []

    def wait(self, timeout: float) -> int | None:
        self.pauses.append(timeout)
        return None

    def end(self) -> None:
        self.pauses.append(0.0)


def test_the_nearer_the_memory_limit_the_more_often_it_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    used = iter([0.5, 3.0, 3.8, 3.99, 4.01])
    monkeypatch.setattr(processes, "resident_gib", lambda pids: next(used))
    child = Growing()
    ended = supervise.supervise(child, Limits(seconds=1000, memory_gib=4), threading.Event(), begun=lambda: True)
    assert ended == outcome.Outcome(outcome.OUT_OF_MEMORY, "4 GiB")
    assert child.pauses == pytest.approx([0.1, 0.1, 0.1, 0.05, 0.01, 0.0])


@pytest.mark.parametrize(("preparing_s", "limit_s"), [(0.2, 0.1), (0.1, 0.2)])
def test_a_method_that_never_begins_is_ended_too(
    preparing_s: float, limit_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervise, "PREPARING_S", preparing_s)
    monkeypatch.setattr(processes, "resident_gib", lambda pids: 0.0)
    ended = supervise.supervise(Growing(), Limits(limit_s, memory_gib=4), threading.Event(), begun=lambda: False)
    assert ended == outcome.Outcome(outcome.TIMEOUT, "0.2 s to begin")


OK = {"kind": "ok", "detail": ""}
TOLD = {"solve_s": 0.1, "peak_mib": 0.0}
RESULT = {"outcome": OK, "report": TOLD}


def left(folder: Path, report: object) -> Path:
    (folder / "result.json").write_text(report if isinstance(report, str) else json.dumps(report))
    return folder


@pytest.mark.parametrize(
    ("report", "why"),
    [
        ("", "not JSON"),
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ([], r"must be a table, not \[\]"),
        ({"report": TOLD}, "key 'outcome' is missing"),
        ({"outcome": {"kind": "timeout"}, "report": TOLD}, "'timeout' is not for a child to tell"),
        ({"outcome": {"kind": "fine"}, "report": TOLD}, "outcome.kind must be 'ok' or 'timeout'"),
        ({"outcome": {"kind": ["ok"]}, "report": TOLD}, r"outcome.kind must be .*, not \['ok'\]"),
        (RESULT | {"report": TOLD | {"solve_s": "1"}}, "report.solve_s must be a number or none, not '1'"),
        (RESULT | {"report": TOLD | {"solve_s": 10**400}}, "report.solve_s has more than 64 bits"),
        (RESULT | {"report": TOLD | {"checkpoints": 3}}, "report.checkpoints must be a list of tables, not 3"),
        (RESULT | {"report": TOLD | {"wall_s": 0.0}}, "report: unknown key 'wall_s'"),
        (RESULT | {"report": {}}, "does not tell what the solution took"),
        (RESULT, "cannot be read"),
        (" " * (LARGEST_RESULT + 1), f"has {LARGEST_RESULT + 1} bytes"),
    ],
)
def test_a_result_that_is_none_is_invalid_output(tmp_path: Path, report: object, why: str) -> None:
    with pytest.raises(UnusableError, match=why):
        read_output(left(tmp_path, report))


@given(st.binary(max_size=200))
def test_no_result_is_too_odd(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    folder = tmp_path_factory.mktemp("left")
    (folder / "result.json").write_bytes(content)
    with pytest.raises(UnusableError):
        read_output(folder)


def test_an_estimate_is_checked_to_its_last_byte(tmp_path: Path) -> None:
    left(tmp_path, RESULT)
    path = tmp_path / "estimate.npz"
    save_estimate(path, Estimate(np.tile(np.eye(3), (4, 1, 1))))
    assert read_output(tmp_path) == Result(outcome.Outcome(outcome.OK), Report(solve_s=0.1, peak_mib=0.0))
    whole = path.read_bytes()
    for wrong in (whole[:-1], whole[:-100], whole[: len(whole) // 2], whole.replace(b"\xf0?", b"\xf1?", 1), b""):
        path.write_bytes(wrong)
        with pytest.raises(UnusableError, match=r"estimate\.npz"):
            read_output(tmp_path)


@pytest.mark.parametrize(
    ("arrays", "why"),
    [
        ({"rotations": np.eye(3)}, "no rotations"),
        ({"rotation": np.zeros((4, 3, 3))}, "no rotations"),
        ({"rotations": np.zeros((4, 3, 3), np.float32)}, "not an array of float64"),
        ({"rotations": np.array([{}])}, "not an array of float64"),
        ({"rotations": np.zeros((4, 3, 3)), "checkpoints": np.zeros((2, 4, 3, 3))}, "checkpoints"),
    ],
)
def test_an_estimate_of_another_form_is_invalid_output(tmp_path: Path, arrays: dict[str, np.ndarray], why: str) -> None:
    np.savez(left(tmp_path, RESULT) / "estimate.npz", **arrays)
    with pytest.raises(UnusableError, match=why):
        read_output(tmp_path)


def test_a_bomb_is_no_estimate(tmp_path: Path) -> None:
    path = left(tmp_path, RESULT) / "estimate.npz"
    np.savez_compressed(path, rotations=np.zeros((10**5, 3, 3)))
    with pytest.raises(UnusableError, match="compressed"):
        read_output(tmp_path)
    with zipfile.ZipFile(path, "w") as archive, archive.open("rotations.npy", "w") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 3, 3)})
    with pytest.raises(UnusableError, match="not an array of float64"):
        read_output(tmp_path)


def test_every_member_of_a_family_is_found_and_killed(marks: Path) -> None:
    """A tree of processes, one of them in another session."""
    pid = os.fork()
    if pid == 0:
        os.setsid()
        if os.fork() == 0:
            os.setsid()
            os.fork()
        (marks / str(os.getpid())).touch()
        time.sleep(100)
        os._exit(0)
    while len(list(marks.iterdir())) < 3:
        time.sleep(0.01)
    assert sorted(processes.family(pid)) == sorted(int(mark.name) for mark in marks.iterdir())
    assert processes.family(pid)[0] == pid
    assert processes.resident_gib(processes.family(pid)) > 0
    processes.kill(pid)
    os.waitpid(pid, 0)
