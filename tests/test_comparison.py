"""Comparing two runs: verdicts, exit codes and what is not compared."""

import csv
import io
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import bench
from scipy import stats

from bench.core import so3
from bench.core.errors import InputError
from bench.core.outcome import CRASHED, Outcome
from bench.reporting.tables.compared import comparison_grid, verdict
from bench.scoring.comparison import Comparison, compare
from bench.scoring.inference.ratio import Ratio, error_ratio, mean_ratio, time_ratio
from bench.scoring.metrics.errors import summary
from bench.scoring.results import Results
from bench.storage.store import Store

CAMERAS = 60


def scored(
    factors: dict[str, float],
    scenes: int = 4,
    seeds: int = 1,
    changed: dict[tuple[int, str], str] | None = None,
    draw: int = 0,
    **more: object,
) -> Results:
    """A run in which a method's errors are a factor times what is drawn for each scene and camera."""
    rows, errors, by_job = [], {}, {}
    for k in range(scenes):
        place = ("d", f"s{k}", "all")
        base = np.random.default_rng(k).gamma(2, 1, (seeds, CAMERAS))
        for method, factor in factors.items():
            noise = np.exp(
                0.1
                * np.random.default_rng([k, draw, *method.encode(), int(1000 * factor)]).standard_normal(
                    (seeds, CAMERAS)
                )
            )
            for seed in range(seeds):
                status = (changed or {}).get((k, method), "ok")
                own = factor * base[seed] * noise[seed] if status == "ok" else np.full(CAMERAS, np.nan)
                errors.setdefault(place, {}).setdefault((method, ""), []).append(own)
                row = {"dataset": "d", "instance": f"s{k}", "instance_key": f"{k}-{seed}", "protocol": "all"}
                job = f"{k}-{method}-{seed}"
                by_job[job] = own
                row |= {"method": method, "params": "", "seed": seed, "status": status, "outcome": status, "job": job}
                row |= {"n_solved": CAMERAS if status == "ok" else 0}
                rows.append(row | summary(own) | more)
    held = {place: {m: tuple(e) for m, e in own.items()} for place, own in errors.items()}
    return Results(pd.DataFrame(rows), held, {}, (), "l1", {}, by_job)


def verdicts(found: Comparison, level: str = "method") -> dict[str, set[str]]:
    rows = found.rows[found.rows["level"] == level]
    return {str(method): set(own["verdict"]) for method, own in rows.groupby("method")}


def test_a_run_is_identical_to_itself() -> None:
    run = scored({"a": 1.0, "b": 2.0}, changed={(0, "b"): "timeout"})
    found = compare(run, run)
    assert found.identical
    assert not found.regressed
    assert found.outcomes == ()
    assert verdicts(found) == {"a": {"identical"}, "b": {"identical"}}
    assert verdict(found) == "identical"


@pytest.mark.parametrize("scenes", [1, 4])
def test_worse_better_and_neither(scenes: int) -> None:
    old = scored({"a": 1.0, "b": 1.0, "c": 1.0, "d": 1.0}, scenes)
    new = scored({"a": 1.5, "b": 0.6, "c": 1.001, "d": 1.0}, scenes)
    found = compare(old, new)
    assert verdicts(found) == {"a": {"worse"}, "b": {"better"}, "c": {"cannot tell"}, "d": {"identical"}}
    assert found.regressed
    rows = found.rows.set_index(["level", "method", "quantity"])
    row = rows.loc[("method", "a", "median")]
    assert row["ratio"] == pytest.approx(1.5, rel=0.1)
    assert row["low"] < row["ratio"] < row["high"]
    assert row["p_holm"] >= row["p_value"]
    assert "worse: a" in verdict(found)


def test_p_values_pay_for_the_others_of_their_level_and_for_three_levels() -> None:
    """Two quantities overall, four of two methods, sixteen on their four scenes: the smallest pays for all of them."""
    found = compare(scored({"a": 1.0, "b": 1.0}, draw=1), scored({"a": 1.1, "b": 1.0}, draw=2))
    for level, count in (("all", 2), ("method", 4), ("scene", 16)):
        rows = found.rows[found.rows["level"] == level].sort_values("p_value")
        assert len(rows) == count
        raw, paid = rows[["p_value", "p_holm"]].iloc[0]
        assert raw < 1 / (3 * count)
        assert paid == pytest.approx(3 * count * raw)


def test_what_is_identical_costs_the_others_nothing() -> None:
    old, new = {"a": 1.0, "b": 1.0}, {"a": 1.1, "b": 1.0}
    alone, beside = (
        compare(scored({k: old[k] for k in names}), scored({k: new[k] for k in names})).rows for names in ("a", "ab")
    )
    for level in ("method", "scene"):
        paid = [rows[(rows["level"] == level) & (rows["method"] == "a")]["p_holm"].tolist() for rows in (alone, beside)]
        assert paid[0] == paid[1]


def test_seeds_with_an_instance_each_are_a_t_test() -> None:
    old, new = scored({"a": 1.0}, 1, seeds=6, draw=1), scored({"a": 1.1}, 1, seeds=6, draw=2)
    place = ("d", "s0", "all")
    logs = [[np.log(np.median(errors)) for errors in run.errors[place]["a", ""]] for run in (new, old)]
    expected = stats.ttest_rel(*logs).confidence_interval(0.95)
    rows = compare(old, new).rows.set_index(["level", "quantity"])
    found = rows.loc[("scene", "median")]
    assert (found["low"], found["high"]) == pytest.approx((np.exp(expected.low), np.exp(expected.high)))


def test_the_threshold_says_what_is_no_regression() -> None:
    found = compare(scored({"a": 1.0}, 8), scored({"a": 1.2}, 8), threshold=1.5)
    assert verdicts(found) == {"a": {"cannot tell"}}
    assert not found.regressed
    assert compare(scored({"a": 1.0}, 8), scored({"a": 1.2}, 8), threshold=1.1).regressed


def test_one_bad_scene_of_many_is_a_regression() -> None:
    old, new = scored({"a": 1.0}, 5), scored({"a": 1.0}, 5)
    new.job_errors["3-a-0"] = 3 * old.job_errors["3-a-0"]  # type: ignore[index]
    found = compare(old, new)
    assert verdicts(found) == {"a": {"cannot tell"}}
    told = found.rows[(found.rows["level"] == "scene") & (found.rows["verdict"] == "worse")]
    assert set(told["instance"]) == {"s3"}
    assert found.regressed
    text = comparison_grid(found, "l1", 1.05)
    assert ("a", "s3", "median") in [facts for facts, _ in text.rows]


def test_equally_good_runs_rarely_alarm() -> None:
    """Twelve comparisons of six methods on three scenes, where nothing but chance differs."""
    names = {f"m{k}": 1.0 for k in range(6)}
    alarms = [
        compare(scored(names, 3, draw=2 * k), scored(names, 3, draw=2 * k + 1), threshold=1.0).regressed
        for k in range(12)
    ]
    assert sum(alarms) <= 2


def test_outcomes() -> None:
    old = scored({"a": 1.0, "b": 1.0}, changed={(0, "a"): "timeout"})
    new = scored({"a": 1.0, "b": 1.0}, changed={(1, "b"): "crashed(SIGSEGV)"})
    new.frame.loc[new.frame["instance"] == "s2", "n_solved"] = CAMERAS - 1
    found = compare(old, new)
    assert [str(outcome) for outcome in found.outcomes] == [
        "a on d/s0, seed 0: timeout -> ok",
        "b on d/s1, seed 0: ok -> crashed(SIGSEGV)",
        "a on d/s2, seed 0: 60 cameras solved -> 59",
        "b on d/s2, seed 0: 60 cameras solved -> 59",
    ]
    assert [outcome.worse for outcome in found.outcomes] == [False, True, True, True]
    assert found.regressed
    more = compare(new, old).outcomes
    assert [outcome.worse for outcome in more] == [True, False, False, False]


def test_what_is_not_compared_is_said() -> None:
    old, new = scored({"a": 1.0, "b": 1.0}), scored({"a": 1.0, "c": 1.0})
    new.frame.loc[new.frame["instance"] == "s1", "instance_key"] = "other"
    found = compare(old, new, no_times="no timing run")
    assert found.cells == 3
    assert found.notes == (
        "4 jobs are only in the first run: not compared",
        "4 jobs are only in the second run: not compared",
        "1 job is on data that have changed: not compared",
        "times are not compared: no timing run",
    )
    with pytest.raises(InputError, match="no problem, method and seed in common"):
        compare(scored({"a": 1.0}), scored({"b": 1.0}))


def test_times_of_timing_runs() -> None:
    rounds = [1.0, 1.1, 0.9, 1.05, 0.95]
    old, new = scored({"a": 1.0}), scored({"a": 1.0})
    old.frame["round_s"] = [rounds] * 4
    new.frame["round_s"] = [[2 * second for second in rounds]] * 4
    found = compare(old, new)
    row = found.rows.set_index(["level", "quantity"]).loc[("method", "time")]
    assert row["ratio"] == pytest.approx(2)
    assert row["verdict"] == "worse"
    assert "time" not in set(compare(old, new, no_times="packed").rows["quantity"])


def test_ratios() -> None:
    assert mean_ratio([Ratio(2.0), Ratio(0.5)]).value == pytest.approx(1)
    found = time_ratio(np.array([2.0, 2.2, 1.8]), np.array([1.0, 1.1, 0.9]))
    assert found.low < found.value < found.high
    assert found.p_value == pytest.approx(stats.ttest_ind(np.log([2.0, 2.2, 1.8]), np.log([1.0, 1.1, 0.9])).pvalue)
    assert np.isnan(mean_ratio([]).value)
    few = error_ratio(np.full((1, 5), 2.0), np.full((1, 5), 1.0), "mean", same_cameras=True)
    assert few.value == pytest.approx(2)
    assert np.isnan([few.low, few.high, few.p_value]).all()


def worsened(run: Path, copy: Path) -> Path:
    """A copy of a run in which one method's cameras are turned at random, and another one's job has crashed."""
    shutil.copytree(run, copy)
    for path in (copy / "records").glob("*/*.json"):
        store = Store(copy)
        record = store.record(path.stem)
        assert record is not None
        if record.job.method == "l1-irls":
            estimate = copy / "estimates" / path.parent.name / f"{path.stem}.npz"
            rotations = store.estimate(path.stem).rotations
            turned = so3.exp(0.3 * np.random.default_rng(0).standard_normal((len(rotations), 3))) @ rotations
            np.savez(estimate, **dict(np.load(estimate)) | {"rotations": turned})
            path.touch()  # as if both had been written anew
        else:
            store.add_record(replace(record, outcome=Outcome(CRASHED, "SIGSEGV")), None)
    return copy


def test_the_command_and_its_exit_codes(tmp_path: Path) -> None:
    run = tmp_path / "run"
    bench(
        "run", "-m", "spanning-tree", "-m", "l1-irls", "-d", "erdos-renyi[n=30,missing=0.2]", "--out", run, "--seeds", 2
    )
    assert bench("compare", run, run).stdout.splitlines()[-1] == "identical"

    worse = worsened(run, tmp_path / "worse")
    done = bench("compare", run, worse, "--format", "csv", code=1)
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    assert "worse" in {r["verdict"] for r in rows if r["level"] == "method" and r["method"] == "l1-irls"}
    assert [r["verdict"] for r in rows if r["level"] == "outcome"] == ["ok -> crashed(SIGSEGV)"] * 2
    assert "times are not compared" in done.stderr.lower()
    assert "worse: l1-irls" in bench("compare", run, worse, "--format", "markdown", code=1).stdout
    assert "nothing is worse" in bench("compare", worse, run).stdout

    assert "is not the folder of a run" in bench("compare", run, tmp_path / "none", code=2).stderr
    assert "--threshold is a ratio of at least 1" in bench("compare", run, run, "--threshold", "0.5", code=2).stderr
