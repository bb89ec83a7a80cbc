"""Timing runs: turns are taken, what is stored is what was measured, and no table confuses it with packed times."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.core import outcome
from bench.core.errors import InputError
from bench.core.outcome import Outcome
from bench.core.problem import Estimate, Problem
from bench.execution import child
from bench.execution.child import Request
from bench.execution.execute import Ended
from bench.execution.output import ESTIMATE_FILE
from bench.reporting.tables import render
from bench.reporting.tables.printed import exact_seconds
from bench.running.engines import timing
from bench.running.run import Options, Run
from bench.scoring.metrics.speedup import speedup
from bench.scoring.results import score
from bench.storage.arrays import load_problem, save_estimate, save_problem
from bench.storage.record import Report
from bench.suite.experiment import load_suite, suite_names

METHODS = ["faulty[fault=[fine,random,raise]]"]


def planned(plugin: Path, out: Path | None, methods: list[str] = METHODS, **options: Any) -> Run:
    settings = {"out": out, "plugins": (plugin,), "timeout_s": 30.0, "timing": True, "rounds": 3} | options
    return Run("quick", methods, ["toy[n=[3,4]]"], Options(**settings))


def finish(run: Run) -> list[str]:
    run.prepare()
    return [record.outcome.text for _, record in run.execute()]


@pytest.fixture
def turns(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str]]:
    """Rounds that take no time: (instance, fault) of each child that would have been started, in order."""
    taken: list[tuple[str, str]] = []

    def execute(request: Request, *_: Any) -> Ended:
        fault = request.parameters.get("fault", "fine")
        instance = Path(request.problem).parent.name
        taken.append((instance, fault))
        if fault == "raise" and taken.count((instance, fault)) == 2:
            return Ended(Outcome(outcome.ERROR, "second time"))
        identity = np.tile(np.eye(3), (load_problem(Path(request.problem)).n, 1, 1))
        save_estimate(Path(request.folder, ESTIMATE_FILE), Estimate(identity))
        seconds = {"fine": 2.0, "random": 1.0, "raise": 4.0}[fault] * len(taken)
        return Ended(Outcome(outcome.OK), Report(solves_s=(9 * seconds, seconds, seconds / 9), waited=0.3))

    monkeypatch.setattr(timing, "execute", execute)
    return taken


def test_methods_take_turns_on_one_instance_after_another(
    faulty_plugin: Path, tmp_path: Path, turns: list[tuple[str, str]]
) -> None:
    run = planned(faulty_plugin, tmp_path)
    assert finish(run) == 2 * ["error(second time)", "ok", "ok"]
    keys = list(dict.fromkeys(cell.job.instance_key for cell in run.cells))
    one = ["fine", "random", "raise", "raise", "random", "fine", "fine", "random"]
    assert turns == [(key, fault) for key in keys for fault in one]


def test_a_record_has_every_round_and_their_median(
    faulty_plugin: Path, tmp_path: Path, turns: list[tuple[str, str]]
) -> None:
    run = planned(faulty_plugin, tmp_path)
    finish(run)
    record = run.store.record(run.cells[0].job.id)
    assert record is not None
    assert record.round_s == (2.0, 12.0, 14.0)
    assert (record.report.solve_s, record.report.waited) == (12.0, 0.3)
    assert record.job.rounds == 3
    failed = run.store.record(run.cells[2].job.id)
    assert failed is not None
    assert failed.outcome.text == "error(second time)"
    assert failed.round_s == ()


def test_an_instance_is_timed_again_as_a_whole(
    faulty_plugin: Path, tmp_path: Path, turns: list[tuple[str, str]]
) -> None:
    run = planned(faulty_plugin, tmp_path)
    finish(run)
    assert planned(faulty_plugin, tmp_path).todo == []
    run.store.record_path(run.cells[1].job.id).unlink()
    assert [cell.job.id for cell in planned(faulty_plugin, tmp_path).todo] == [c.job.id for c in run.cells[:3]]
    assert len(planned(faulty_plugin, tmp_path, rounds=4).todo) == 6


def test_real_children(faulty_plugin: Path, tmp_path: Path) -> None:
    mark = tmp_path / "solves"
    run = planned(faulty_plugin, tmp_path / "run", [f"faulty[fault=[fine,slow,segfault],mark={mark}]"], rounds=2)
    assert sorted(finish(run)) == 2 * ["crashed(SIGSEGV)"] + 4 * ["ok"]
    frame = score(run.store).frame
    ok = frame[frame["status"] == "ok"]
    assert [len(rounds) for rounds in ok["round_s"]] == [2, 2, 2, 2]
    assert (ok["min_s"] > 0).all()
    assert (ok["min_s"] <= ok["solve_s"]).all()
    fast, slow = ok[ok["params"].str.contains("fine")], ok[ok["params"].str.contains("slow")]
    assert (slow["min_s"].to_numpy() > fast["min_s"].to_numpy()).all()
    solves = [line.split()[0] for line in mark.read_text().splitlines()]
    assert len(set(solves)) == 2 * (2 + 2 + 1)  # a child for each round, and none after a crash
    assert max(solves.count(pid) for pid in solves) > 3  # what is fast is repeated within a round


def test_no_repetition_finds_what_another_has_left_in_its_problem(tmp_path: Path) -> None:
    plugin = tmp_path / "leaver.py"
    plugin.write_text(LEAVER)
    problem = tmp_path / "problem.npz"
    save_problem(problem, Problem(2, np.array([(0, 1)]), np.eye(3)[None]))
    seen = tmp_path / "seen"
    request = Request(str(problem), str(plugin), "leaver", {"seen": str(seen)}, 0, 1, str(tmp_path), repeat_s=0.02)
    result = child.solve(request, child.prepare(request))
    found = seen.read_text().split()
    assert len(result.report.solves_s) == len(found) - 1 > 2
    assert set(found) == {"fresh"}


LEAVER = """
from dataclasses import dataclass
import numpy as np
from bench import method

@method("leaver", title="Leaver")
@dataclass(frozen=True)
class Leaver:
    seen: str = ""
    def solve(self, problem, rng):
        with open(self.seen, "a") as file:
            file.write("used " if "mine" in vars(problem) else "fresh ")
        vars(problem)["mine"] = True
        return np.tile(np.eye(3), (problem.n, 1, 1))
"""


def test_ordinary_and_timing_runs_do_not_share_a_folder(faulty_plugin: Path, tmp_path: Path) -> None:
    planned(faulty_plugin, tmp_path / "timed").prepare()
    with pytest.raises(InputError, match="timed holds a timing run; give an ordinary run a folder of its own"):
        planned(faulty_plugin, tmp_path / "timed", timing=False)
    planned(faulty_plugin, tmp_path / "packed", timing=False).prepare()
    with pytest.raises(InputError, match="packed holds an ordinary run; give a timing run a folder of its own"):
        planned(faulty_plugin, tmp_path / "packed")
    assert planned(faulty_plugin, None).store.folder.name == "quick-timing"


def test_the_table_compares_with_the_baseline(
    faulty_plugin: Path, tmp_path: Path, turns: list[tuple[str, str]]
) -> None:
    run = planned(faulty_plugin, tmp_path)
    finish(run)
    results = score(run.store)
    random = results.frame[results.frame["params"] == "fault=random"].iloc[0]
    assert random["speedup"] == pytest.approx(12.0 / 5.0)
    assert random["speedup_low"] == pytest.approx(2.0 / 2.0)
    assert random["speedup_high"] == pytest.approx(12.0 / 5.0)
    text, _ = render.render(results.frame, {}, ())
    line = next(line for line in text.splitlines() if "faulty[fault=random]" in line)
    assert re.search(r" 5\.00 +2\.00 +2\.4 \(1 to 2\.4\)", line)
    assert "median and least of 3 rounds" in " ".join(text.split())
    assert "faster than faulty[fault=fine]" in " ".join(text.split())
    assert "up to 30 % of a time went by waiting for the core" in " ".join(text.split())
    assert "packed" not in text


def test_speedup_is_the_ratio_of_the_medians_with_the_range_of_the_rounds() -> None:
    assert speedup([10.0, 20.0, 30.0], [1.0, 4.0, 2.0]) == (10.0, 5.0, 15.0)


@pytest.mark.parametrize(
    ("value", "text"), [(0.0123456, "0.0123"), (0.5, "0.500"), (31.44, "31.4"), (1234.5, "1234"), (np.nan, "–")]
)
def test_seconds_have_three_digits(value: float, text: str) -> None:
    assert exact_seconds(value) == text


def test_a_baseline_is_one_of_the_methods(tmp_path: Path) -> None:
    suite = tmp_path / "mine.toml"
    suite.write_text('datasets = ["erdos-renyi"]\nmethods = ["l1-irls", "colmap"]\nbaseline = "colmp"\n')
    with pytest.raises(InputError, match="the baseline 'colmp' is not one of its methods; did you mean 'colmap'"):
        load_suite(str(suite))


def test_suites_that_name_a_baseline_can_be_read() -> None:
    assert load_suite("speed").baseline in load_suite("speed").methods
    assert all(load_suite(name).rounds > 0 for name in suite_names())
