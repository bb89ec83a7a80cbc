"""The oracle's pick: made by scoring, labelled, and never a competitor."""

from pathlib import Path

import numpy as np
import pytest

from bench.core import so3
from bench.core.problem import Checkpoint, Estimate
from bench.running.run import Options, Run
from bench.scoring.metrics.oracle import curve
from bench.scoring.results import score

WANDERER = '''
"""A method that passes by a good answer on its way."""
from dataclasses import dataclass
import numpy as np
from bench.core.problem import Checkpoint, Estimate
from bench.plugins.declare import method


@method("wanderer", title="Wanderer")
@dataclass(frozen=True)
class Wanderer:
    """Solves the complete graph exactly at its second checkpoint, and forgets it."""

    def solve(self, problem, rng):
        lost = np.tile(np.eye(3), (problem.n, 1, 1))
        good = lost.copy()
        good[1:] = problem.rotations[problem.edges[:, 0] == 0].transpose(0, 2, 1)
        steps = [Checkpoint(10 * k, float(k), r) for k, r in enumerate([lost, good, lost])]
        return Estimate(lost, iterations=20, checkpoints=tuple(steps))
'''


def test_the_curve_knows_its_best_checkpoint() -> None:
    rng = np.random.default_rng(0)
    truth = so3.random(rng, 20)
    noises = (0.5, 0.01, 0.2)
    checkpoints = [
        Checkpoint(k, k / 10, so3.exp(noise * rng.standard_normal((20, 3))) @ truth) for k, noise in enumerate(noises)
    ]
    along = curve(Estimate(checkpoints[-1].rotations, checkpoints=tuple(checkpoints)), truth)
    assert along is not None
    assert along.oracle == 1
    assert along.mean_deg[1] < 2 < along.mean_deg[2] < along.mean_deg[0]


def test_there_is_no_curve_without_checkpoints_or_truth() -> None:
    rotations = so3.random(np.random.default_rng(0), 5)
    assert curve(Estimate(rotations), rotations) is None
    estimate = Estimate(rotations, checkpoints=(Checkpoint(0, 0.0, rotations),))
    assert curve(estimate, np.full((5, 3, 3), np.nan)) is None


@pytest.fixture
def run(faulty_plugin: Path, tmp_path: Path) -> Run:
    plugin = tmp_path / "wanderer.py"
    plugin.write_text(WANDERER)
    options = Options(out=tmp_path / "run", plugins=(faulty_plugin, plugin))
    run = Run("quick", ["wanderer", "l1-irls"], ["toy[n=15]"], options)
    run.prepare()
    assert [record.outcome.text for _, record in run.execute()] == ["ok", "ok"]
    return run


def test_the_oracle_is_a_row_of_its_own_on_request_only(run: Run) -> None:
    assert not score(run.store).frame["params"].str.contains("oracle").any()
    results = score(run.store, oracle=True)
    rows = results.frame.set_index(["method", "params"])
    assert rows.loc[("wanderer", ""), "mean_deg"] > 10
    pick = rows.loc[("wanderer", "oracle")]
    assert pick["mean_deg"] < 1e-6
    assert (pick["iterations"], pick["solve_s"]) == (10, 1.0)
    assert "picked by the smallest error against ground truth" in pick["notes"]
    assert np.isnan(pick["residual_median_deg"])
    (ties,) = results.ties.values()
    assert ties == {("l1-irls", "")}


def test_the_figure_of_errors_over_iterations_is_drawn(run: Run, tmp_path: Path) -> None:
    from bench.reporting.present import write_plots

    paths = write_plots(score(run.store, checkpoints=True), tmp_path / "plots")
    assert {p.suffix for p in paths if p.stem == "error-over-iterations"} == {".png", ".pdf", ".svg"}
