"""Area under the ROC curve of edge weights: the number, and where it is shown."""

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import trapezoid

from bench.reporting.tables import render
from bench.reporting.tables.printed import area
from bench.running.run import Options, Run
from bench.scoring.metrics.roc import roc_auc, roc_curve
from bench.scoring.results import Results, score


def test_is_the_share_of_pairs_in_the_right_order() -> None:
    rng = np.random.default_rng(0)
    weights, outliers = rng.integers(0, 6, 60).astype(float), rng.random(60) < 0.4
    difference = weights[~outliers][:, None] - weights[outliers]
    wanted = ((difference > 0) + 0.5 * (difference == 0)).mean()
    assert roc_auc(weights, outliers) == pytest.approx(wanted, abs=1e-14)
    assert roc_auc(-weights, outliers) == pytest.approx(1 - wanted, abs=1e-14)


def test_edges_without_a_weight_take_no_part() -> None:
    weights = np.array([3.0, 1, np.nan, 2, np.nan])
    assert roc_auc(weights, np.array([False, True, True, True, False])) == 1


def test_infinite_and_equal_weights() -> None:
    assert roc_auc(np.array([np.inf, np.inf, 1, 0]), np.array([False, False, True, True])) == 1
    assert roc_auc(np.ones(4), np.array([False, True, True, True])) == 0.5


@pytest.mark.parametrize("outliers", [[True, True], [False, False]])
def test_one_kind_alone_has_no_curve(outliers: list[bool]) -> None:
    assert np.isnan(roc_auc(np.array([1.0, 2.0]), np.array(outliers)))


@pytest.mark.parametrize("levels", [6, 10**6])
def test_the_area_is_that_under_the_curve(levels: int) -> None:
    rng = np.random.default_rng(1)
    weights, outliers = rng.integers(0, levels, 500).astype(float), rng.random(500) < 0.4
    weights[~outliers] += levels // 3  # a whole number: some inliers and outliers tie
    weights[:20] = np.nan
    lost, caught = roc_curve(weights, outliers, points=1000)
    assert trapezoid(caught, lost) == pytest.approx(roc_auc(weights, outliers), abs=1e-12)
    assert (lost[0], caught[0], lost[-1], caught[-1]) == (0, 0, 1, 1)
    assert len(roc_curve(weights, outliers, points=50)[0]) <= 51
    assert len(roc_curve(weights, np.ones(500, dtype=bool))[0]) == 0


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """A method with edge weights and one without, on a graph with known outliers."""
    out: Path = tmp_path_factory.mktemp("run")
    datasets = ["erdos-renyi[n=[20,25],noise_deg=1]"]
    run = Run("quick", ["spanning-tree", "spectral"], datasets, Options(out=out, timeout_s=30.0))
    run.prepare()
    for _ in run.execute():
        pass
    return score(run.store)


def test_is_a_column_of_the_results(results: Results) -> None:
    by_method = results.frame.groupby("method")["roc_auc"]
    assert by_method.get_group("spanning-tree").between(0.4, 1).all()
    assert by_method.get_group("spectral").isna().all()
    back = pd.read_csv(io.StringIO(render.render(results.frame, results.ties, (), "csv")[0]))
    np.testing.assert_array_equal(back["roc_auc"], results.frame["roc_auc"])


@pytest.mark.parametrize("style", ["console", "markdown", "latex"])
def test_is_shown_where_it_is_known(results: Results, style: str) -> None:
    tree = results.frame[results.frame["method"] == "spanning-tree"]
    text, _ = render.render(results.frame, results.ties, (), style)
    assert "AUC" in text
    assert "area under the ROC curve" in " ".join(text.split())
    for _, rows in tree.groupby("instance"):
        assert area(rows["roc_auc"].mean()) in text
    without, _ = render.render(results.frame.assign(roc_auc=np.nan), results.ties, (), style)
    assert "AUC" not in without


def test_only_a_perfect_area_is_printed_as_one() -> None:
    assert [area(value) for value in (1.0, 0.99999, 0.5, float("nan"))] == ["1", "0.9999", "0.5000", "–"]
