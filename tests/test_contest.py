"""One method of a run against others of the same run."""

import csv
import io
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import bench
from scipy import stats
from test_comparison import CAMERAS, scored

import bench as door
from bench.core.errors import InputError
from bench.reporting.tables.contested import contest_grids
from bench.reporting.tables.latex import latex
from bench.scoring.contest import contest
from bench.scoring.inference.ratio import error_ratio
from tests.runs import Made, made_run


def overall(rows: pd.DataFrame, quantity: str = "median") -> pd.DataFrame:
    """Rows over all scenes by the other method."""
    return rows[(rows["level"] == "overall") & (rows["quantity"] == quantity)].set_index("method")


def test_wins_ties_and_losses() -> None:
    found = contest(
        scored({"mine": 1.0, "worse": 1.6, "same": 1.0, "better": 0.6}), ["mine", "worse", "same", "better"]
    )
    rows = overall(found.rows)
    assert rows["verdict"].tolist() == ["win", "tie", "loss"]
    assert rows[["wins", "ties", "losses"]].to_numpy().tolist() == [[4, 0, 0], [0, 4, 0], [0, 0, 4]]
    worse = rows.loc["worse"]
    assert worse["ratio"] == pytest.approx(1 / 1.6, rel=0.05)
    assert worse["low"] < worse["ratio"] < worse["high"] < 1
    assert worse["own"] / worse["other"] == pytest.approx(worse["ratio"], rel=0.05)


def test_a_scene_is_the_paired_bootstrap_and_all_scenes_a_t_test() -> None:
    """The statistic is the one that runs are compared by."""
    run = scored({"mine": 1.0, "other": 1.2})
    found = contest(run, ["mine", "other"])
    scenes = found.rows[(found.rows["level"] == "scene") & (found.rows["quantity"] == "median")]
    one, other = (np.stack(run.errors["d", "s0", "all"][name, ""]) for name in ("mine", "other"))
    expected = error_ratio(one, other, "median", same_cameras=True)
    assert scenes.iloc[0][["ratio", "low", "high", "p_value"]].tolist() == [
        *(expected.value, expected.low, expected.high, expected.p_value)
    ]
    whole = overall(found.rows).loc["other"]
    test = stats.ttest_1samp(np.log(scenes["ratio"]), 0)
    assert whole["p_value"] == pytest.approx(test.pvalue)
    interval = test.confidence_interval(0.95)
    assert (whole["low"], whole["high"]) == pytest.approx((np.exp(interval.low), np.exp(interval.high)))


def test_p_values_pay_for_all_methods_quantities_and_two_levels() -> None:
    found = contest(scored({"mine": 1.0, "a": 1.1, "b": 1.0}), ["mine", "a", "b"])
    for level, count in (("overall", 4), ("scene", 16)):
        rows = found.rows[found.rows["level"] == level].sort_values("p_value")
        assert len(rows) == count
        assert rows["p_holm"].iloc[0] == pytest.approx(min(1, 2 * count * rows["p_value"].iloc[0]))
    alone = contest(scored({"mine": 1.0, "a": 1.1}, scenes=1), ["mine", "a"]).rows
    assert alone.groupby("level")["p_holm"].min()["scene"] == pytest.approx(2 * alone["p_value"].min())


def test_a_method_that_failed_on_a_scene_loses_there_and_does_not_win_over_all() -> None:
    run = scored({"mine": 1.0, "other": 2.0}, changed={(2, "mine"): "timeout"})
    row = overall(contest(run, ["mine", "other"]).rows).loc["other"]
    assert row[["wins", "ties", "losses"]].tolist() == [3, 0, 1]
    assert row["verdict"] == "tie"
    assert row["ratio"] == pytest.approx(0.5, rel=0.05)
    turned = overall(contest(run, ["other", "mine"]).rows).loc["mine"]
    assert turned[["wins", "ties", "losses"]].tolist() == [1, 0, 3]
    assert turned["verdict"] == "tie"


def test_a_method_that_failed_everywhere_loses() -> None:
    failed = {(k, "mine"): "crashed(SIGSEGV)" for k in range(4)}
    row = overall(contest(scored({"mine": 1.0, "other": 2.0}, changed=failed), ["mine", "other"]).rows).loc["other"]
    assert (row["verdict"], row["losses"]) == ("loss", 4)


def test_leaving_out_hard_cameras_is_a_loss() -> None:
    run = scored({"mine": 1.0, "other": 2.0}, scenes=1)
    (own,) = run.errors["d", "s0", "all"]["mine", ""]
    own[: CAMERAS // 10] = np.nan
    row = overall(contest(run, ["mine", "other"]).rows).loc["other"]
    assert (row["verdict"], row["why"]) == ("tie", "fewer cameras")
    assert row["losses"] == 1


def test_what_did_not_run_is_not_held_against_it() -> None:
    run = scored({"mine": 1.0, "other": 2.0}, changed={(2, "mine"): "not-installed"})
    found = contest(run, ["mine", "other"])
    assert overall(found.rows).loc["other", ["wins", "losses"]].tolist() == [3, 0]
    assert found.notes == ("1 job has not been run: not compared", "1 job has no counterpart: not compared")


def test_one_method_alone_is_compared_with_all_others() -> None:
    run = scored({"a": 1.0, "b": 1.0, "c": 1.0})
    assert contest(run, ["b"]).others == (("a", ""), ("c", ""))


def test_a_deterministic_method_stands_for_every_seed_of_one_instance() -> None:
    run = scored({"mine": 1.0, "other": 1.5}, scenes=1, seeds=3)
    run.frame["instance_key"] = "same"
    kept = run.frame[(run.frame["method"] == "other") | (run.frame["seed"] == 0)]
    found = contest(type(run)(kept, run.errors, {}, (), "l1", {}, run.job_errors), ["mine", "other"])
    assert found.notes == ()
    assert overall(found.rows).loc["other", "ratio"] == pytest.approx(1 / 1.5, rel=0.2)


def test_methods_are_named_as_they_are_selected() -> None:
    run = scored({"mine": 1.0, "other": 1.5})
    run.frame.loc[run.frame["method"] == "mine", "params"] = "depth=2,loss=l1"
    assert contest(run, ["mine", "other"]).method == ("mine", "depth=2,loss=l1")
    assert contest(run, ["mine[loss=l1,depth=2]"]).method == ("mine", "depth=2,loss=l1")
    for wrong, message in (
        (["mine[depth=3]"], r"no method 'mine\[depth=3\]'; did you mean 'mine\[depth=2,loss=l1\]'"),
        (["mine[depth=[2,3]]"], "one configuration, not a grid"),
        (["othr"], "did you mean 'other'"),
        ([], "name the method"),
    ):
        with pytest.raises(InputError, match=message):
            contest(run, wrong)
    with pytest.raises(InputError, match="is the only method here"):
        contest(scored({"mine": 1.0}), ["mine"])


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("contest") / "run"
    made_run(folder, ["a", "b", "c"], [Made("mine"), Made("l1-irls", 6.0), Made("other", 1.02)], seeds=3, cameras=80)
    return folder


def test_the_command(run: Path) -> None:
    text = bench("compare", "--methods", "mine", "l1-irls", "other", run).stdout
    assert "mine against 2 other methods over 3 scenes; errors in degrees, l1 alignment" in text
    assert re.search(r"l1-irls +median .* win\* +3 / 0 / 0", text)
    assert re.search(r"\n *a +l1-irls +median ", text)
    rows = list(csv.DictReader(io.StringIO(bench("compare", "--methods", "mine", run, "--format", "csv").stdout)))
    assert {row["level"] for row in rows} == {"overall", "scene"}
    markdown = bench("compare", "--methods", "mine", "l1-irls", run, "--format", "markdown").stdout
    assert "| l1-irls | median |" in markdown
    assert "did you mean 'mine'" in bench("compare", "--methods", "mne", "other", run, code=2).stderr
    assert "and then the run" in bench("compare", "--methods", run, code=2).stderr
    assert "compare takes two runs, not 1" in bench("compare", run, code=2).stderr
    assert door.compare(run, ["mine"])["verdict"].tolist() == [row["verdict"] for row in rows]


def test_latex_is_two_booktabs_tables() -> None:
    grids = contest_grids(contest(scored({"mine": 1.0, "a_b": 1.6}), ["mine"]), "l1", 1.05)
    text = latex(grids)
    assert text.count(r"\toprule") == 2
    assert r"a\_b & median" in text
    assert r"\textbf{win}" in text
    assert "4 / 0 / 0" in text
