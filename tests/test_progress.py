"""How long a run takes, and what is shown while it runs."""

import os
import re
import select
import signal
import struct
import subprocess
import sys
import time
import types
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from commands import bench
from rich.console import Console

import bench as door
from bench.core.limits import Limits
from bench.core.outcome import Kind, Outcome
from bench.running.progress import board as board_module
from bench.running.progress.board import Board
from bench.running.progress.notebook import in_notebook
from bench.running.progress.pace import Pace, Task, remaining_s, span
from bench.storage.record import Record, Report
from bench.suite.plan import Job

SIZES = (1e4, 1e5, 1e6)


JOB = Job("0", "toy", "toy", "0", "a", "A", "", {}, 0)


def record(solve_s: float | None, besides_s: float = 0.0, kind: Kind = "ok") -> Record:
    return Record(
        JOB, Outcome(kind), Limits(60, 4), "", report=Report(solve_s=solve_s), wall_s=(solve_s or 0.0) + besides_s
    )


def pace_of(times: Callable[[float], float], sizes: Sequence[float] = SIZES, configured: str = "a") -> Pace:
    pace = Pace()
    for size in sizes:
        pace.see(Task(configured.partition("[")[0], configured, size), record(times(size)))
    return pace


def test_nothing_is_expected_as_long_as_nothing_was_seen() -> None:
    assert Pace().expect(Task("a", "a", 1e5)) is None
    assert remaining_s(Pace(), [Task("a", "a")]) is None
    assert remaining_s(Pace(), []) == 0


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_time_is_a_power_of_the_size(exponent: float) -> None:
    pace = pace_of(lambda size: (size / 1e5) ** exponent)
    assert pace.expect(Task("a", "a", 1e5)) == pytest.approx(1, rel=0.3)
    assert pace.expect(Task("a", "a", 1e7)) == pytest.approx(100**exponent, rel=0.6)


def test_of_one_size_time_grows_in_proportion() -> None:
    pace = pace_of(lambda _: 2.0, sizes=[1e5] * 5)
    assert pace.expect(Task("a", "a", 1e5)) == pytest.approx(2)
    assert pace.expect(Task("a", "a", 1e6)) == pytest.approx(20, rel=0.05)
    assert pace.expect(Task("a", "a")) == pytest.approx(2)  # of unknown size


def test_what_has_no_times_is_like_its_method_and_else_like_all() -> None:
    pace = pace_of(lambda _: 1.0, configured="sdp[a=1]")
    for name in ("x", "y"):
        pace.see(Task(name, name, 1e5), record(8.0))
    assert pace.expect(Task("sdp", "sdp", 1e5)) == pytest.approx(1, rel=0.3)
    assert pace.expect(Task("new", "new", 1e5)) == pytest.approx(8)
    assert pace.knows(Task("sdp", "sdp"))
    assert not pace.knows(Task("new", "new"))


def test_what_the_first_jobs_wait_for_is_not_expected_of_all() -> None:
    pace = Pace()
    for besides in (7.0, 6.0, 0.03, 0.03, 0.03, 0.03):
        pace.see(Task("a", "a", 1e5), record(0.1, besides))
    assert pace.expect(Task("a", "a", 1e5)) == pytest.approx(0.13)


def test_a_job_without_a_time_teaches_nothing_and_a_failed_one_its_wall_clock() -> None:
    pace = Pace()
    pace.see(Task("a", "a", 1e5), record(None, kind="not-installed"))
    assert pace.seen == 0
    pace.see(Task("a", "a", 1e5), record(None, 60.0, "timeout"))
    assert pace.expect(Task("a", "a", 1e5)) == pytest.approx(60)


def test_one_long_job_outlasts_forty_short_ones() -> None:
    pace = Pace()
    pace.see(Task("short", "short", 1e5), record(1.0))
    pace.see(Task("sdp", "sdp", 1e5), record(40.0))
    short, long = Task("short", "short", 1e5), Task("sdp", "sdp", 1e5)
    assert remaining_s(pace, [long, *[short] * 40], workers=2) == pytest.approx(40)
    assert remaining_s(pace, [*[short] * 40, long], workers=2) == pytest.approx(60)
    assert remaining_s(pace, [short] * 40, [(long, 30.0)], workers=2) == pytest.approx(25)
    assert remaining_s(pace, [], [(long, 30.0)], workers=2) == pytest.approx(10)
    assert remaining_s(pace, [], [(long, 80.0)], workers=2) == pytest.approx(20)  # overdue


def test_durations_are_words() -> None:
    words = [span(s) for s in (0.2, 59.4, 59.9, 125, 12_000, 180_000)]
    assert words == ["0 s", "59 s", "1 min 00 s", "2 min 05 s", "3 h 20 min", "2 d 2 h"]


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def jobs_of(methods: int, instances: int) -> list[Job]:
    return [
        Job(f"{i}x{m}", "toy", f"an-instance-with-a-long-name-{i}", str(i), f"method-{m}", "", "", {"depth": m}, 0)
        for i in range(instances)
        for m in range(methods)
    ]


def board_of(jobs: Sequence[Job], workers: int = 2, **options: Any) -> tuple[Board, Clock]:
    clock = Clock()
    task = {job.id: Task(job.method, f"{job.method}[depth={job.parameters['depth']}]", 1e5) for job in jobs}
    return Board(jobs, lambda job: task[job.id], Pace(), workers, clock=clock, **options), clock


def drawn(board: Board, width: int = 80, height: int = 24) -> list[str]:
    console = Console(width=width, height=height, force_terminal=True, color_system=None, legacy_windows=False)
    with console.capture() as capture:
        console.print(board)
    return capture.get().splitlines()


def test_the_table_tells_what_is_done_failed_running_and_left() -> None:
    jobs = jobs_of(3, 4)
    board, clock = board_of(jobs)
    assert "ETA unknown" in drawn(board)[-1]
    clock.now = 1.0
    board.end(jobs[1], record(None, 1.0, "timeout"))
    board.end(jobs[0], record(1.0))
    clock.now = 2.0
    lines = drawn(board)
    first, second, third = lines[1:4]
    assert re.search(r"method-0\[depth=0\] +1/4 +1 +1 s +1 s an-instance", first)
    assert re.search(r"method-1\[depth=1\] +1/4 +1 +", second)
    assert re.search(r"method-2\[depth=2\] +0/4 +.* 1 s an-instance", third)
    assert "2/12 jobs · 2 s · ETA 4 s · 2 at a time" in lines[-1]


def test_the_eta_counts_down() -> None:
    jobs = jobs_of(1, 11)
    board, clock = board_of(jobs, workers=1)
    clock.now = 2.0
    board.end(jobs[0], record(2.0))
    assert board.eta_s() == pytest.approx(20)
    clock.now = 3.0
    assert board.eta_s() == pytest.approx(19)


def test_jobs_that_end_out_of_order_are_counted_once() -> None:
    jobs = jobs_of(2, 5)
    board, _ = board_of(jobs)
    for job in reversed(jobs):
        board.end(job, record(0.1))
    assert "10/10 jobs" in drawn(board)[-1]
    assert board.eta_s() == 0


@pytest.mark.parametrize("width", [40, 80, 160])
@pytest.mark.parametrize("height", [8, 24])
def test_a_wide_list_of_methods_folds_into_the_terminal(width: int, height: int) -> None:
    jobs = jobs_of(40, 3)
    board, _ = board_of(jobs, workers=2)
    for job in jobs[:100]:
        board.end(job, record(0.1))
    lines = drawn(board, width, height)
    assert len(lines) < height
    assert max(map(len, lines)) <= width
    text = "\n".join(lines)
    assert re.search(r"… \d+ more", text)
    counted = re.findall(r" (\d+)/(\d+) ", "\n".join(lines[1:-1]))
    assert sum(int(total) for _, total in counted) == len(jobs)
    assert "method-20" in text  # it runs
    assert ("running now" in text) == (width >= 80)


def test_ending_a_job_draws_and_foresees_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    jobs = jobs_of(10, 1000)
    board, _ = board_of(jobs)
    monkeypatch.setattr(board_module, "remaining_s", lambda *_, **__: pytest.fail("not when a job ends"))
    for job in jobs:
        board.end(job, record(0.001))


def test_a_refresh_of_the_eta_waits_many_times_what_it_took(monkeypatch: pytest.MonkeyPatch) -> None:
    board, clock = board_of(jobs_of(2, 5))
    calls = []

    def slow(*_: Any, **__: Any) -> float:
        calls.append(clock.now)
        clock.now += 0.1
        return 60.0

    monkeypatch.setattr(board_module, "remaining_s", slow)
    for _ in range(100):
        board.eta_s()
        clock.now += 0.1
    assert 2 <= len(calls) <= 4


def arguments(plugin: Path, out: Path, *faults: str) -> list[str]:
    methods = [word for fault in faults for word in ("-m", f"faulty[fault={fault}]")]
    return ["run", "--plugin", str(plugin), *methods, "-d", "toy", "--seeds", "4", "--jobs", "2", "--out", str(out)]


def run_quietly(plugin: Path, out: Path, *faults: str, **options: Any) -> None:
    """The same without a console, tables and plots."""
    methods = [f"faulty[fault={fault}]" for fault in faults]
    door.run(methods=methods, datasets=["toy"], seeds=4, jobs=2, plugins=(plugin,), out=out, **options)


def test_without_a_terminal_there_is_a_line_for_each_job_and_no_escape(faulty_plugin: Path, tmp_path: Path) -> None:
    done = bench(*arguments(faulty_plugin, tmp_path / "run", "fine", "raise"))
    assert len(re.findall(r"^ *\d/8  toy5 .*", done.stdout, re.MULTILINE)) == 8
    assert "\x1b" not in done.stdout + done.stderr


def test_a_dry_run_tells_how_long_it_takes(faulty_plugin: Path, tmp_path: Path) -> None:
    first = bench(*arguments(faulty_plugin, tmp_path / "a", "slow"), "--dry-run")
    assert "time: unknown, for there is no earlier record" in first.stdout
    run_quietly(faulty_plugin, tmp_path / "a", "slow")
    beside = bench(*arguments(faulty_plugin, tmp_path / "b", "slow"), "--dry-run")
    found = re.search(r"time: about (\d+) s, 2 at a time, going by 4 earlier records$", beside.stdout, re.MULTILINE)
    assert found is not None
    assert int(found[1]) >= 1  # four jobs of 0.3 s, two at a time
    done = bench(*arguments(faulty_plugin, tmp_path / "a", "slow"), "--dry-run")
    assert "time:" not in done.stdout


def in_terminal(words: Sequence[str], interrupt_at: str = "") -> tuple[str, int]:
    """Run ``python -m bench`` on a pseudo-terminal of 80 by 24; what it wrote, and its exit code."""
    pty = pytest.importorskip("pty")
    fcntl, termios = pytest.importorskip("fcntl"), pytest.importorskip("termios")
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    environment = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "LINES", "NO_COLOR")}
    environment["TERM"] = "xterm-256color"
    command = [sys.executable, "-m", "bench", *words]
    child = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment)
    os.close(theirs)
    out = b""
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        if select.select([ours], [], [], 0.1)[0]:
            try:
                data = os.read(ours, 65536)
            except OSError:  # the other end is closed
                break
            if not data:
                break
            out += data
        if interrupt_at and interrupt_at.encode() in out:
            interrupt_at = ""
            child.send_signal(signal.SIGINT)
    os.close(ours)
    return out.decode(), child.wait(timeout=30)


def plain(text: str) -> str:
    return re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text).replace("\r", "\n")


def test_on_a_terminal_there_is_a_live_table_that_goes_away(faulty_plugin: Path, tmp_path: Path) -> None:
    text, code = in_terminal(arguments(faulty_plugin, tmp_path / "run", "slow", "raise"))
    assert code == 0, text
    assert "\x1b[2K" in text  # the table is drawn over and erased
    shown = plain(text)
    assert re.search(r"method +done +failed +mean s +left +running now", shown)
    assert re.search(r"faulty\[fault=slow\] +\d/4 .* \d s toy5", shown)
    assert re.search(r"\d/8 jobs · \d+ s · ETA \d+ s · 2 at a time", shown)
    assert len(re.findall(r"^ *\d/8  toy5 .*error", shown, re.MULTILINE)) == 4
    assert re.search(r"8 jobs in .*: 4 ok, 4 error", shown)
    assert "not told apart" in " ".join(shown.split())  # the results follow
    drawn_lines = [line for line in shown.splitlines() if "jobs ·" in line or "toy5" in line[30:]]
    live = [line for line in drawn_lines if "error" not in line]
    assert max(map(len, live)) <= 80


def test_ctrl_c_on_a_terminal_ends_with_130_and_keeps_what_is_done(faulty_plugin: Path, tmp_path: Path) -> None:
    text, code = in_terminal(arguments(faulty_plugin, tmp_path / "run", "slow"), interrupt_at="ETA")
    assert code == 130, text
    assert "interrupted; what is done is kept in" in plain(text)
    assert text.rstrip().endswith("continues")
    assert text.count("\x1b[?25l") == text.count("\x1b[?25h")  # the cursor is back


def test_of_earlier_runs_every_method_is_read_and_no_timing_run(faulty_plugin: Path, tmp_path: Path) -> None:
    from bench.running.progress.past import Past
    from bench.running.run import Options, Run

    faults = ("fine", "raise", "skip", "slow")
    run_quietly(faulty_plugin, tmp_path / "a", *faults)
    run_quietly(faulty_plugin, tmp_path / "timed", "fine", timing=True, rounds=2)
    methods = [f"faulty[fault={fault}]" for fault in faults]
    planned = Run(None, methods, ["toy"], Options(out=tmp_path / "b", seeds=6, plugins=(faulty_plugin,)))
    past = Past(planned)
    assert past.pace.seen == 16
    assert {past.task(cell.job).configured for cell in planned.cells} == set(methods)
    assert all(past.pace.knows(past.task(cell.job)) for cell in planned.cells)


def test_a_notebook_shows_the_board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a kernel is asked to show: one output, and its last state."""
    shown: list[str] = []

    class Output:
        def update(self, what: object) -> None:
            shown.append(repr(what))

    def display(what: object, display_id: bool) -> Output:
        assert display_id
        shown.append(repr(what))
        return Output()

    kernel = types.SimpleNamespace(kernel=object())
    ipython = types.SimpleNamespace(get_ipython=lambda: kernel, display=types.SimpleNamespace(display=display))
    assert not in_notebook()
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", ipython.display)
    assert in_notebook()
    door.run(methods=["spectral"], datasets=["erdos-renyi[n=8,missing=0.2]"], out=tmp_path / "run", seeds=2)
    assert "0/2 jobs" in shown[0]
    assert "2/2 jobs" in shown[-1]
    before = len(shown)
    door.run(methods=["spectral"], datasets=["erdos-renyi[n=8,missing=0.2]"], out=tmp_path / "run", seeds=2)
    assert len(shown) == before  # nothing was to do
