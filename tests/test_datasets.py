"""The built-in datasets: what they promise of the instances they yield."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import load, the_source, write_scene

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Problem
from bench.datasets._files import folders
from bench.datasets._simulated.noise import Noise
from bench.datasets._simulated.statistics import hardness
from bench.datasets.erdos_renyi import ErdosRenyi
from bench.datasets.one_dsfm import SCENES, OneDSfM
from bench.datasets.pose_graph import PoseGraph, propagated
from bench.plugins.catalog import catalog
from bench.plugins.declare import Missing, Source

pytestmark = pytest.mark.usefixtures("elsewhere")


# --- erdos-renyi -------------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(
    n=st.integers(2, 40),
    missing=st.floats(0, 0.5),
    noise=st.floats(0, 30),
    outliers=st.floats(0, 1),
    model=st.sampled_from(["haar", "authors"]),
    seed=st.integers(0, 1000),
)
def test_random_graphs_are_what_was_asked_for(
    n: int, missing: float, noise: float, outliers: float, model: str, seed: int
) -> None:
    instance = load(ErdosRenyi(n, missing, noise, outliers, model), seed=seed)  # type: ignore[arg-type]
    assert instance.problem.n == n
    assert not instance.problem.components.any()
    assert instance.truth is not None
    assert instance.outliers is not None
    assert instance.outliers.sum() == round(outliers * instance.problem.m)
    np.testing.assert_allclose(
        instance.truth @ np.swapaxes(instance.truth, 1, 2), np.tile(np.eye(3), (n, 1, 1)), atol=1e-14
    )


def test_noise_and_outliers_have_the_distributions_of_the_paper() -> None:
    instance = load(ErdosRenyi(n=200, missing=0.5), seed=3)
    problem, truth = instance.problem, instance.truth
    assert truth is not None
    assert instance.outliers is not None
    i, j = problem.edges.T
    noise = np.swapaxes(truth[i] @ np.swapaxes(truth[j], 1, 2), 1, 2) @ problem.rotations  # R_ij N_ij, on the right
    vectors = np.degrees(so3.log(noise))
    inliers, outliers = vectors[~instance.outliers], vectors[instance.outliers]
    angles = np.linalg.norm(inliers, axis=1)
    # |N(0, 5)|: mean of squares 25, 68.27 % below 5, and not the angle of three Gaussian components
    assert np.mean(angles**2) == pytest.approx(25, rel=0.06)
    assert np.mean(angles < 5) == pytest.approx(0.6827, abs=0.02)
    axes = inliers / angles[:, None]
    assert np.abs(axes.T @ axes / len(axes) - np.eye(3) / 3).max() < 0.02
    # Haar: density of the angle (1 - cos) / pi, mean pi/2 + 2/pi
    assert np.mean(np.linalg.norm(outliers, axis=1)) == pytest.approx(np.degrees(np.pi / 2 + 2 / np.pi), abs=2)
    share = problem.m / (200 * 199 / 2)
    assert share == pytest.approx(0.5, abs=4 * np.sqrt(0.25 / (200 * 199 / 2)))


def test_the_authors_outliers_are_biased() -> None:
    instance = load(ErdosRenyi(n=60, outliers=1.0, outlier_model="authors"))
    mean = np.linalg.norm(instance.problem.rotations.mean(axis=0))
    haar = np.linalg.norm(load(ErdosRenyi(n=60, outliers=1.0)).problem.rotations.mean(axis=0))
    assert mean > 0.3
    assert haar < 0.15


def test_the_seed_decides_and_nothing_else() -> None:
    one, same, other = (load(ErdosRenyi(n=30), seed=seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one.problem.rotations, same.problem.rotations)
    assert one.revision == same.revision != other.revision
    assert one.problem.edges.shape != other.problem.edges.shape or (one.problem.edges != other.problem.edges).any()
    assert the_source(ErdosRenyi()).seeded


def test_parameter_sets_have_their_own_name_and_revision() -> None:
    default = ErdosRenyi()
    changes = [
        {},
        {"n": 50},
        {"missing": 0.8},
        {"noise_deg": 2.0},
        {"outliers": 0.1},
        {"outlier_model": "authors"},
        {"noise": "tangent"},
        {"noise": "langevin"},
    ]
    sources = [the_source(dataclasses.replace(default, **change)) for change in changes]  # type: ignore[arg-type]
    assert sources[0].name == "n100-missing0.5"
    assert len({s.name for s in sources}) == len({s.revision for s in sources}) == len(changes)


@pytest.mark.parametrize("noise", ["tangent", "langevin"])
def test_other_noise_has_three_components(noise: Noise) -> None:
    instance = load(ErdosRenyi(n=100, noise_deg=4.0, noise=noise))
    assert instance.outliers is not None
    residuals = np.degrees(instance.problem.residuals(instance.truth))[~instance.outliers]  # type: ignore[arg-type]
    assert np.mean(residuals**2) == pytest.approx(3 * 4.0**2, rel=0.06)
    assert instance.name == f"n100-missing0.5-noise4.0-{noise}-noise"
    assert f"{noise} noise" in instance.source


def test_a_graph_that_is_never_connected_is_refused() -> None:
    with pytest.raises(InputError, match="choose a smaller missing or a larger n"):
        load(ErdosRenyi(n=30, missing=0.99))


# --- 1dsfm -------------------------------------------------------------------------------------------


def test_truth_subgraph_keeps_the_cameras_with_truth(tmp_path: Path) -> None:
    rotations = write_scene(tmp_path / "Ellis_Island", images=9, unregistered=(2, 5))
    instance = load(OneDSfM(scene="Ellis_Island"), tmp_path)
    known = [1, 3, 4, 6, 7, 8]
    assert instance.protocol == "truth-subgraph"
    assert instance.truth is not None
    assert so3.angle_between(instance.truth, rotations[known]).max() < 1e-12
    assert instance.problem.m == 15
    assert instance.problem.residuals(instance.truth).max() < 1e-5
    assert instance.statistics == pytest.approx({"cameras": 6, "edges_percent": 100, "hardness": 1})
    assert "covers 6 of the 227 cameras that papers score" in instance.notes[0]


def test_component_keeps_all_cameras(tmp_path: Path) -> None:
    write_scene(tmp_path / "Ellis_Island", images=9, unregistered=(2, 5))
    instance = load(OneDSfM(scene="Ellis_Island", protocol="component"), tmp_path)
    assert instance.truth is not None
    assert instance.problem.n == 8
    assert np.isnan(instance.truth).all(axis=(1, 2)).nonzero()[0].tolist() == [1, 4]
    assert instance.revision != the_source(OneDSfM(scene="Ellis_Island"), tmp_path).revision


def test_a_scene_without_truth_is_not_scored(tmp_path: Path) -> None:
    write_scene(tmp_path / "Union_Square")
    (tmp_path / "Union_Square" / "gt_bundle.out").unlink()
    instance = load(OneDSfM(scene="Union_Square"), tmp_path)
    assert (instance.truth, instance.protocol, instance.problem.n) == (None, "component", 8)
    assert "not scored" in instance.notes[0]


def test_scenes_that_are_not_on_disk_come_with_the_command(tmp_path: Path) -> None:
    write_scene(tmp_path / "1dsfm" / "Ellis_Island")
    write_scene(tmp_path / "1dsfm" / "My_Scene")
    sources = list(OneDSfM().sources(tmp_path, 0))
    assert [s.name for s in sources] == sorted([*SCENES, "My_Scene"])
    assert [s.name for s in sources if isinstance(s, Source)] == ["Ellis_Island", "My_Scene"]
    assert Missing("Alamo") in sources


def test_the_users_folder_comes_first(tmp_path: Path, elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The named folder, then the environment variable, then the downloads."""
    places = [elsewhere / "1dsfm", tmp_path / "variable", tmp_path / "named"]
    cameras = []
    for k, place in enumerate(places):
        write_scene(place / "Alamo", images=5 + k, unregistered=())
        if k == 1:
            monkeypatch.setenv(folders.VARIABLE, str(place))
        cameras.append(load(OneDSfM(scene="Alamo"), place if k == 2 else None).problem.n)
    assert cameras == [4, 5, 6]


def test_unknown_scenes_and_folders_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="did you mean 'Ellis_Island'"):
        list(OneDSfM(scene="Elis_Island").sources(None, 0))
    with pytest.raises(InputError, match="the data folder is not a folder"):
        list(OneDSfM().sources(tmp_path / "none", 0))
    monkeypatch.setenv(folders.VARIABLE, str(tmp_path / "none"))
    with pytest.raises(InputError, match="ROTSYNC_DATA_DIR is not a folder"):
        list(OneDSfM().sources(None, 0))


def test_a_truth_that_joins_no_edge_is_refused(tmp_path: Path) -> None:
    write_scene(tmp_path / "Alamo", images=5, unregistered=(1, 2, 3))
    with pytest.raises(InputError, match=r"gt_bundle\.out: no edge joins two cameras with ground truth"):
        load(OneDSfM(scene="Alamo"), tmp_path)


def test_verify_names_what_is_wrong(tmp_path: Path) -> None:
    write_scene(tmp_path / "Alamo")
    write_scene(tmp_path / "Yorkminster")
    (tmp_path / "Yorkminster" / "cc.txt").write_text("x\n")
    assert OneDSfM().verify(tmp_path) == [
        ("Alamo", "ok"),
        (
            "Yorkminster",
            f"{tmp_path}/Yorkminster/cc.txt:1: 'x' is not a camera id; a line holds one camera id",
        ),
    ]
    with pytest.raises(InputError, match="data fetch 1dsfm"):
        OneDSfM().verify(None)


def test_the_revision_follows_the_files(tmp_path: Path) -> None:
    write_scene(tmp_path / "Alamo")
    before = the_source(OneDSfM(scene="Alamo"), tmp_path).revision
    with (tmp_path / "Alamo" / "cc.txt").open("a") as file:
        file.write("\n")
    assert the_source(OneDSfM(scene="Alamo"), tmp_path).revision != before


@pytest.mark.real_data
def test_ellis_island_is_the_published_problem(real_data: Path) -> None:
    """227 cameras and hardness 0.0088, as Table I of the founding paper prints them."""
    instance = load(OneDSfM(scene="Ellis_Island"), real_data)
    assert instance.truth is not None
    assert (instance.problem.n, instance.problem.m) == (227, 20010)
    assert round(instance.statistics["hardness"], 4) == 0.0088
    assert instance.notes == ()
    assert not instance.problem.components.any()
    assert np.degrees(np.median(instance.problem.residuals(instance.truth))) == pytest.approx(2.89, abs=0.01)


@pytest.mark.real_data
@pytest.mark.parametrize(("scene", "count", "published"), [("Madrid_Metropolis", 176, 341), ("NYC_Library", 274, 332)])
def test_scenes_with_partial_truth_say_so(real_data: Path, scene: str, count: int, published: int) -> None:
    instance = load(OneDSfM(scene=scene), real_data)
    assert instance.problem.n == count
    assert any(f"covers {count} of the {published} cameras" in note for note in instance.notes)


# --- pose-graph --------------------------------------------------------------------------------------


def test_sphere2500_comes_with_its_truth() -> None:
    pytest.importorskip("gtsam")
    instance = load(PoseGraph())
    assert instance.truth is not None
    assert (instance.problem.n, instance.problem.m) == (2500, 4949)
    residuals = np.degrees(instance.problem.residuals(instance.truth))
    assert np.median(residuals) == pytest.approx(1.79, abs=0.01)
    assert residuals.max() < 10


def test_sphere2500_is_found_without_importing_gtsam(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    (source,) = PoseGraph().sources(None, 0)
    assert source == Missing("sphere2500", "python -m pip install 'gtsam>=4.3'")


@pytest.mark.parametrize("folder", [".", "pose_graphs"])
def test_g2o_files_of_the_data_folder(tmp_path: Path, folder: str) -> None:
    (tmp_path / folder).mkdir(exist_ok=True)
    (tmp_path / folder / "tiny.g2o").write_text("EDGE_SE3:QUAT 4 7 0 0 0 0 0 0 1\n")
    instance = load(PoseGraph("tiny"), tmp_path)
    assert (instance.problem.n, instance.truth) == (2, None)
    assert "not scored" in instance.notes[-1]
    (source,) = PoseGraph("tini").sources(tmp_path, 0)
    assert isinstance(source, Missing)
    assert f"put tini.g2o in {tmp_path}" in source.command
    assert "did you mean 'tiny'" in source.command


def test_rotations_are_propagated_over_a_connected_graph() -> None:
    truth = so3.random(np.random.default_rng(0), 6)
    edges = np.array([[0, 3], [1, 3], [1, 2], [2, 5], [0, 4], [4, 5]])
    i, j = edges.T
    problem = Problem(6, edges, truth[i] @ np.swapaxes(truth[j], 1, 2))
    assert problem.residuals(propagated(problem)).max() < 1e-14
    with pytest.raises(InputError, match="not connected"):
        propagated(Problem(6, edges[:3], problem.rotations[:3]))


# --- statistics --------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [12, 700, 20_000])
def test_hardness_of_a_ring(n: int) -> None:
    """Its second eigenvalue is 2 - 2 cos(2 pi / n); small, large and very thin graphs take different ways."""
    edges = np.array([[0, n - 1], *([k, k + 1] for k in range(n - 1))])
    ring = Problem(n, edges, np.tile(np.eye(3), (n, 1, 1)))
    assert hardness(ring) == pytest.approx((2 - 2 * np.cos(2 * np.pi / n)) / n, rel=1e-6)
    assert hardness(Problem(n + 1, edges, ring.rotations)) == 0


def test_the_clairvoyant_graph_is_the_same_without_its_outliers() -> None:
    info = catalog("dataset")["erdos-renyi"]
    (plain,), (without,) = (
        list(info.configure({"n": 20, "clairvoyant": c}).sources(None, seed=3)) for c in (False, True)
    )
    assert plain.revision != without.revision
    whole, inliers = plain.load(), without.load()
    assert whole.outliers is not None
    assert inliers.outliers is not None
    kept = ~whole.outliers
    assert (inliers.problem.edges == whole.problem.edges[kept]).all()
    assert (inliers.problem.rotations == whole.problem.rotations[kept]).all()
    assert (inliers.truth == whole.truth).all()  # type: ignore[union-attr]
    assert not inliers.outliers.any()
    assert (inliers.name, len(inliers.notes)) == ("n20-missing0.5-clairvoyant", 1)
