"""Real graphs against simulated ones of the same run."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import bench
from scenes import write_scene

import bench as door
from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Floats, Instance, Problem
from bench.reporting.figures.calibrated import methods_on_both
from bench.reporting.tables.calibrated import calibration_grid, verdicts
from bench.scoring.calibration.agreement import Calibration, calibrate
from bench.scoring.calibration.fingerprint import BANDS_DEG, COHERENCE, ERROR, coherence, fingerprint
from bench.scoring.results import score
from tests.graphs import random_edges
from tests.runs import Made, made_run

IDENTITY = np.tile(np.eye(3), (40, 1, 1))


def instance(errors_deg: Floats, **given: object) -> Instance:
    """Cameras that all look the same way, with edges wrong by rotation vectors (m, 3) in the frame of camera i."""
    edges = random_edges(40, 0.5)
    problem = Problem(40, edges, so3.exp(np.radians(errors_deg)))
    return Instance(problem, IDENTITY, "made", **given)  # type: ignore[arg-type]


def count() -> int:
    return len(random_edges(40, 0.5))


def test_quantiles_and_axes_are_those_of_the_errors() -> None:
    errors = np.zeros((count(), 3))
    errors[:, 1] = np.linspace(0, 40, count())
    found = fingerprint(instance(errors))
    assert [found[ERROR, f"{level} %"] for level in (5, 50, 95)] == pytest.approx([2, 20, 38])
    assert found["axes of good edges", "pan"] == pytest.approx(10, abs=0.1)
    assert found["axes of outliers", "pan"] == pytest.approx(30, abs=0.1)
    assert found["axes of outliers", "roll"] == pytest.approx(0, abs=1e-9)
    assert found["outliers", "share"] == pytest.approx(0.5, abs=0.01)
    assert found["outliers", "level"] == 1
    assert found["relative angle", "90 %"] == 0


def test_closures_of_exact_measurements_are_zero() -> None:
    found = fingerprint(instance(np.zeros((count(), 3))))
    assert found["triangle closure", "95 %"] == pytest.approx(0, abs=1e-9)


def test_coherence_is_near_one_of_independent_errors_and_large_where_they_point_the_same_way() -> None:
    rng = np.random.default_rng(0)
    edges = random_edges(60, 0.5)
    independent = rng.standard_normal((len(edges), 3))
    assert coherence(edges, independent, -independent, 0, 9) == pytest.approx(0.85, abs=0.15)
    one_sided = np.tile([1.0, 0, 0], (len(edges), 1))
    expected = np.sqrt(np.median(np.bincount(edges.ravel())))
    assert coherence(edges, one_sided, one_sided, 0, 9) == pytest.approx(expected, rel=0.05)
    assert np.isnan(coherence(edges, one_sided, one_sided, 2, 9))


def test_a_graph_without_truth_has_no_fingerprint() -> None:
    given = instance(np.zeros((count(), 3)))
    with pytest.raises(InputError, match="no edge has ground truth"):
        fingerprint(Instance(given.problem, None, "unknown"))
    half = IDENTITY.copy()
    half[20:] = np.nan
    found = fingerprint(Instance(given.problem, half, "half"))
    assert found[ERROR, "95 %"] == pytest.approx(0, abs=1e-9)


METHODS = ("spanning-tree", "spectral", "l1-irls", "weiszfeld")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small real scene, two twins of it, and a dataset without names in common."""
    folder = tmp_path_factory.mktemp("calibration")
    write_scene(folder / "data" / "Square", images=14)
    of = "twin[of='1dsfm[scene=Square]',errors=[correlated,independent]]"
    datasets = ["1dsfm[scene=Square]", of, "erdos-renyi[n=20]"]
    door.run(methods=METHODS, datasets=datasets, seeds=2, data_dir=folder / "data", out=folder / "run")
    return folder / "run"


def calibrated(folder: Path) -> Calibration:
    from bench.storage.store import Store

    store = Store.open(folder)
    return calibrate(store, score(store))


def test_simulated_graphs_are_compared_with_the_real_one_they_are_named_after(run: Path) -> None:
    found = calibrated(run)
    laws = list(dict.fromkeys(found.rows["law"]))
    assert laws == ["twin", "twin-independent", "erdos-renyi"]
    assert set(found.rows["instance"]) == {"Square"}
    assert set(found.medians["twin", "Square"]) == set(METHODS)
    degrees = found.rows[(found.rows["law"] == "twin") & (found.rows["group"] == "degree")]
    assert (degrees["deviation"] == 1).all()
    bands = [f"{low}-{high}" for low, high in BANDS_DEG]
    assert found.rows.loc[found.rows["group"] == COHERENCE, "name"].tolist() == 3 * bands


def test_what_is_far_apart_does_not_agree(run: Path) -> None:
    """Measurements of the real scene are exact, those of the random graphs wrong by degrees."""
    found = calibrated(run)
    rows = found.rows[(found.rows["law"] == "erdos-renyi") & (found.rows["group"] == ERROR)]
    assert not rows["agrees"].astype(bool).any()
    assert "0 of" in " ".join(cell.text for _, cells in calibration_grid(found).rows for cell in cells)
    told = verdicts(found)
    assert len(told) == 3
    assert told[0].startswith("twin: ")
    assert "mean rank correlation" in told[0]


def test_the_verb_prints_tables_and_writes_files(run: Path, tmp_path: Path) -> None:
    done = bench("calibrate", run, "--format", "csv", "--out", tmp_path)
    frame = pd.read_csv(tmp_path / "calibration.csv")
    assert done.stdout == (tmp_path / "calibration.csv").read_text(encoding="utf-8")
    assert len(frame) == len(calibrated(run).rows)
    assert {path.name for path in tmp_path.iterdir()} == {"calibration.csv", "calibration.md"} | {
        f"methods.{ending}" for ending in ("png", "pdf", "svg")
    }
    assert "of 1 quantities" not in done.stderr
    assert [panel.title for panel in methods_on_both(calibrated(run)).panels] == ["Square"]


def test_a_run_without_real_or_without_simulated_graphs_is_refused(tmp_path: Path) -> None:
    made_run(tmp_path / "real", ["A"], [Made("a")])
    done = bench("calibrate", tmp_path / "real", code=2)
    assert "has no simulated graph with ground truth" in done.stderr
    door.run(methods=["spectral"], datasets=["erdos-renyi[n=10]"], out=tmp_path / "simulated")
    done = bench("calibrate", tmp_path / "simulated", code=2)
    assert "has no measured graph with ground truth" in done.stderr
