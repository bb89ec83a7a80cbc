"""Which method for a graph: what it looks like, its twins, evidence, and the answer in words."""

import re
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import bench

from bench import recommend
from bench.advice.choice import choose
from bench.advice.evidence import kept, of_other_graphs
from bench.advice.look import CONSISTENT, CONTESTED, UNCHECKED, look
from bench.advice.recommendation import Recommendation
from bench.advice.trial import load
from bench.advice.words import answer, twins_grid
from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Problem
from bench.suite.experiment import load_suite
from tests.graphs import random_edges, simulated


def written(problem: Problem, path: Path) -> Path:
    np.savez(path, edges=problem.edges, rotations=problem.rotations)
    return path


def chain(n: int) -> Problem:
    return simulated(np.stack([np.arange(n - 1), np.arange(1, n)], axis=1), noise_deg=1.0)[0]


def test_triangles_tell_the_kind_of_a_graph() -> None:
    edges = random_edges(30, 0.6)
    exact = look(simulated(edges)[0])
    assert exact.kind == CONSISTENT
    assert exact.open == 0
    assert exact.closures_deg == pytest.approx([0] * 5, abs=1e-5)
    assert (exact.cameras, exact.edges, exact.components) == (30, len(edges), 1)
    assert look(simulated(edges, outliers=0.5)[0]).kind == CONTESTED
    found = look(chain(40))
    assert found.kind == UNCHECKED
    assert (found.triangles, found.closures_deg, found.outside) == (0, (), 1)


@pytest.mark.parametrize(("axis", "upright"), [(1, True), (2, False)])
def test_cameras_that_roll_are_not_upright(axis: int, upright: bool) -> None:
    edges = random_edges(10, 1.0)
    vectors = np.full((len(edges), 3), 0.01)
    vectors[:, axis] = 0.3
    assert look(Problem(10, edges, so3.exp(vectors))).upright == upright


def test_what_comes_with_the_measurements_is_named() -> None:
    problem = simulated(random_edges(5, 1.0))[0]
    weighted = Problem(5, problem.edges, problem.rotations, np.ones(problem.m), "count", gravity=np.eye(3)[[0] * 5])
    assert look(weighted).carries == ("gravity", "match counts")


def scored(**errors: tuple[float, float, float]) -> pd.DataFrame:
    """A row for each method: median, mean, seconds."""
    rows = [
        {"method": name, "params": "", "outcome": "ok", "median_deg": a, "mean_deg": b, "solve_s": s}
        for name, (a, b, s) in errors.items()
    ]
    return pd.DataFrame(rows)


def test_of_those_as_good_as_the_best_the_quickest_is_recommended() -> None:
    """A tie that is expected to be worse by more than the margin is told, and not taken for being quick."""
    frame = scored(
        slow=(1.0, 2.0, 9.0), near=(1.04, 2.0, 0.5), worse=(1.2, 2.0, 0.1), tail=(1.0, 2.5, 0.1), far=(3, 4, 0)
    )
    choice = choose(frame, {(name, "") for name in ("slow", "near", "worse", "tail")})
    assert choice.recommended.name == "near"
    assert choice.best.name == "slow"
    assert {one.name for one in choice.tied} == {"slow", "worse", "tail"}
    assert choice.behind is not None
    assert choice.behind.name == "far"
    assert choose(frame, {("slow", "")}).recommended.name == "slow"


def test_evidence_is_of_the_kind_where_there_is_enough_and_ranks_decide() -> None:
    rows = kept()
    candidates = {(method, "") for method in load_suite("recommend").methods}
    assert set(zip(rows["method"], rows["params"], strict=True)) == candidates
    contested = of_other_graphs(rows, CONTESTED, candidates)
    assert contested.of_kind
    assert contested.graphs >= 20
    assert not of_other_graphs(rows, UNCHECKED, candidates).of_kind
    able = candidates - {contested.choice.recommended.method}
    assert of_other_graphs(rows, CONTESTED, able).choice.recommended.method in able
    with pytest.raises(InputError, match="nothing is known"):
        of_other_graphs(rows, CONTESTED, {("mine", "")})


def test_the_verb_says_which_method_what_to_expect_and_how_to_solve(tmp_path: Path) -> None:
    graph = written(simulated(random_edges(30, 0.6), noise_deg=2.0, outliers=0.05)[0], tmp_path / "graph.npz")
    methods = ("-m", "l1-irls", "-m", "spectral")
    done = bench("recommend", graph, *methods, "--budget", 30, "--out", tmp_path / "run", "--jobs", 1)
    assert "30 cameras" in done.stdout
    assert re.search(r"Recommended: (l1-irls|spectral)\n", done.stdout)
    assert re.search(r"Error to expect: median [\d.]+ degrees", done.stdout)
    assert "What would change the answer:" in done.stdout
    command = shlex.split(done.stdout.splitlines()[-1])
    assert command[command.index("bench") + 1 :][:2] == ["solve", str(graph)]
    assert "l1-irls" in bench("table", tmp_path / "run").stdout


def test_a_graph_without_triangles_is_told_that_its_twins_are_not_to_be_trusted(tmp_path: Path) -> None:
    graph = written(chain(20), tmp_path / "chain.npz")
    asked = recommend(graph, ["spectral"], budget_s=20, jobs=1)
    assert asked.method == "spectral"
    assert "0 triangles, and 100% of its edges in none" in asked.doubts[0]
    assert asked.evidence is None  # where candidates are named, there may be nothing known of them
    evidence = of_other_graphs(kept(), asked.look.kind, {("spectral", "")})
    told = "\n".join(
        answer(Recommendation(asked.instance, asked.look, asked.trial, asked.on_twins, evidence, asked.doubts))
    )
    assert "twins are not to be trusted" in told
    assert "not to be trusted" in twins_grid(asked).caption
    assert "cannot be predicted" in told
    assert "Error to expect" not in told


SLOW_AT_FIRST = """
import time
from dataclasses import dataclass
from pathlib import Path
import numpy as np
from bench import method


@method("slow-at-first", title="Slow at first")
@dataclass(frozen=True)
class SlowAtFirst:
    compiled: str = ""

    def warm_up(self):
        if not Path(self.compiled).exists():
            time.sleep(5)
            Path(self.compiled).touch()

    def solve(self, problem, rng):
        return np.tile(np.eye(3), (problem.n, 1, 1))
"""


def test_what_is_compiled_at_first_costs_no_candidate_its_turn(tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text(SLOW_AT_FIRST)
    graph = written(simulated(random_edges(10, 1.0))[0], tmp_path / "graph.npz")
    candidates = [f"slow-at-first[compiled={tmp_path / 'compiled'}]", "spectral"]
    asked = recommend(graph, candidates, budget_s=8, jobs=1, plugins=[tmp_path / "slow.py"])
    assert asked.trial.left_out == ()
    assert asked.trial.seconds < 8


def test_what_is_no_graph_or_several_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"stands for \d+ graphs: name one"):
        load("small-graphs")
    graph = written(simulated(random_edges(5, 1.0))[0], tmp_path / "graph.npz")
    assert "above zero" in bench("recommend", graph, "--budget", 0, code=2).stderr
    assert "did you mean" in bench("recommend", graph, "-m", "l1-irl", code=2).stderr
    assert "there is no dataset" in bench("recommend", tmp_path / "none.npz", code=2).stderr
