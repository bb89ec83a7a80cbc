"""End to end on real scenes: the figures that the benchmark stands for."""

from pathlib import Path

import pandas as pd
import pytest

import bench
from bench.scoring.results import Results, score
from bench.storage.store import Store

pytestmark = pytest.mark.real_data

METHODS = [
    "spectral",
    "l1-irls",
    "shonan[loss=[l2,huber]]",
    "colmap",
    "dmf-synch",
]


@pytest.fixture(scope="module")
def ellis(tmp_path_factory: pytest.TempPathFactory) -> tuple[pd.DataFrame, Path]:
    data_dir = Path(__file__).parent.parent.parent / "shared" / "data"
    if not data_dir.is_dir():
        pytest.skip("the real scenes are not on disk")
    out = tmp_path_factory.mktemp("ellis")
    scene = ["1dsfm[scene=Ellis_Island]", "1dsfm[scene=Trafalgar]"]
    frame = bench.run("1dsfm", METHODS, scene, data_dir=data_dir, out=out)
    return frame.set_index(["method", "params"]), out


@pytest.mark.parametrize(
    ("method", "params", "mean", "median"),
    [
        ("spectral", "", (0, 7), (2.5, 3.0)),
        ("shonan", "loss=l2", (6.3, 6.8), (2.7, 3.0)),
        ("shonan", "loss=huber", (0, 5), (0, 1.25)),
        ("l1-irls", "", (0, 3.1), (0, 0.60)),
        ("colmap", "", (0, 3.1), (0, 0.60)),
        ("dmf-synch", "", (0, 3.1), (0, 0.85)),
    ],
)
def test_ellis_island(
    ellis: tuple[pd.DataFrame, Path],
    method: str,
    params: str,
    mean: tuple[float, float],
    median: tuple[float, float],
) -> None:
    row = ellis[0].loc[(method, params)]
    if row["status"].startswith("not-installed"):
        pytest.skip(row["status"])
    assert row["status"] == "ok"
    assert (row["n_cameras"], row["n_solved"], row["n_scored"]) == (227, 227, 227)
    assert round(row["hardness"], 4) == 0.0088
    assert mean[0] <= row["mean_deg"] <= mean[1]
    assert median[0] <= row["median_deg"] <= median[1]


def test_a_scene_that_is_not_on_disk_is_reported_with_its_command(ellis: tuple[pd.DataFrame, Path]) -> None:
    results: Results = score(Store.open(ellis[1]))
    assert "1dsfm/Trafalgar is not on disk; get it with: python -m bench data fetch 1dsfm" in results.footnotes


@pytest.mark.parametrize("rule", ["chordal", "karcher", "anchors"])
def test_the_alignment_moves_the_figures_and_runs_nothing(ellis: tuple[pd.DataFrame, Path], rule: str) -> None:
    frame, out = ellis
    again = score(Store.open(out), rule).frame.set_index(["method", "params"])
    assert (again["solve_s"].dropna() == frame["solve_s"].dropna()).all()
    assert again.loc[("spectral", ""), "median_deg"] != frame.loc[("spectral", ""), "median_deg"]
