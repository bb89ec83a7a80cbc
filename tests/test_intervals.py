"""Intervals in the long table, and figures of rankings where there is enough to rank."""

import io

import numpy as np
import pandas as pd
import pytest
from appearances import using

from bench.reporting.appearance import Appearance
from bench.reporting.figures.paint_matplotlib import paint
from bench.reporting.present import drawings, render_table
from bench.scoring.inference.statistics import confidence_interval
from bench.scoring.metrics.errors import summary
from bench.scoring.results import Results

RANKINGS = {"rank-probabilities", "critical-difference", "performance-profile-error", "performance-profile-time"}


def results(scenes: int, cameras: int = 40, methods: int = 3) -> Results:
    rows, errors, by_job = [], {}, {}
    for k in range(scenes):
        for m in range(methods):
            own = np.random.default_rng([k, m]).gamma(2, 1 + m, cameras)
            errors.setdefault(("d", f"s{k}", "all"), {})[f"m{m}", ""] = (own,)
            by_job[f"{k}-{m}"] = own
            row = {"dataset": "d", "instance": f"s{k}", "instance_key": f"s{k}", "method": f"m{m}", "title": f"M{m}"}
            row |= {
                "params": "",
                "seed": 0,
                "protocol": "all",
                "alignment": "l1",
                "outcome": "ok",
                "status": "ok",
                "notes": "",
                "stop_reason": "",
                "job": f"{k}-{m}",
            }
            row |= {"solve_s": 1.0 + m, "peak_mib": 1.0, "n_cameras": cameras, "n_solved": cameras}
            rows.append(row | summary(own))
    return Results(pd.DataFrame(rows), errors, {}, (), "l1", {}, by_job)


def test_the_long_table_has_the_interval_of_every_row() -> None:
    run = results(2)
    with using(Appearance(order=("m2", "m0"))):
        table = pd.read_csv(io.StringIO(render_table(run, "csv")[0])).set_index(["instance", "method"])
    assert list(table.index[:3]) == [("s0", "m2"), ("s0", "m0"), ("s0", "m1")]
    for (_, instance, _), by_method in run.errors.items():
        for (method, _), (own,) in by_method.items():
            row = table.loc[(instance, method)]
            for statistic in ("mean", "median"):
                expected = confidence_interval(own, statistic)  # type: ignore[arg-type]
                assert (row[f"{statistic}_low_deg"], row[f"{statistic}_high_deg"]) == pytest.approx(expected)
                assert row[f"{statistic}_low_deg"] < row[f"{statistic}_deg"] < row[f"{statistic}_high_deg"]


def test_few_cameras_and_failures_have_none() -> None:
    few = pd.read_csv(io.StringIO(render_table(results(1, cameras=5), "csv")[0]))
    assert few["median_low_deg"].isna().all()
    run = results(1)
    run.frame.loc[1, ["outcome", "status"]] = "timeout"
    run.job_errors["0-1"] = np.full(40, np.nan)  # type: ignore[index]
    run.frame.loc[2, "stop_reason"] = "oracle"
    table = pd.read_csv(io.StringIO(render_table(run, "csv")[0]))
    assert table["mean_high_deg"].isna().tolist() == [False, True, True]


def test_rankings_are_drawn_from_two_problems_on() -> None:
    one, two = results(1), results(2)
    assert not RANKINGS & drawings(one).keys()
    drawn = {name: paint(drawing) for name, drawing in drawings(two).items()}
    assert drawn.keys() >= RANKINGS
    strip = [text.get_text() for text in drawn["rank-probabilities"].axes[0].texts]
    assert strip == ["100", "100", "100"]
    assert [tick.get_text() for tick in drawn["rank-probabilities"].axes[0].get_yticklabels()] == ["M0", "M1", "M2"]
    labels = [text.get_text() for text in drawn["critical-difference"].axes[0].texts]
    assert labels[:3] == ["M0  1.00", "M1  2.00", "M2  3.00"]
    assert "packed accuracy run" in drawn["performance-profile-time"].get_supxlabel()
    assert "Over 2 scenes" in " ".join(drawn["performance-profile-error"].get_supxlabel().split())
    profile = drawn["performance-profile-time"].axes[0].lines[1]  # of M1
    assert profile.get_xdata()[:2] == pytest.approx([1.0, 2.0])
    assert profile.get_ydata()[:2] == pytest.approx([0.0, 100.0])


def test_one_method_is_not_ranked() -> None:
    run = results(3, methods=1)
    assert not RANKINGS & drawings(run).keys()
