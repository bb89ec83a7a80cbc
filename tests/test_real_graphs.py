"""The datasets of real graphs: their layouts, conventions and downloads, and the real files where they are on disk."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from format_seeds import EDGES, MEASURED, TRUTH, N, anisotropic_blocks, mat, scan_summary
from scenes import load, the_source
from test_archive import Server
from test_archive import _no_proxy as _no_proxy
from test_archive import server as server

import bench
from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Floats
from bench.datasets._files import repository as repositories
from bench.datasets._files.repository import Repository, repository
from bench.datasets.anisotropic import Anisotropic
from bench.datasets.image_graph import ImageGraph
from bench.datasets.pose_graph import PoseGraph
from bench.datasets.registration import Registration
from bench.datasets.scan_graph import ScanGraph
from bench.plugins.declare import Missing, Source

pytestmark = pytest.mark.usefixtures("elsewhere")

PUBLISHED = {"3dmatch-toolbox": 37, "learning2sync": 212, "anisotropic-ra": 2}


def write_log(path: Path, rotations: Floats, pairs: list[tuple[int, int]]) -> None:
    """Relative poses of fragments whose rotations (n, 3, 3) are world to camera."""
    blocks = []
    for i, j in pairs:
        pose = np.eye(4)
        pose[:3, :3] = rotations[i] @ rotations[j].T
        rows = "\n".join(" ".join(f"{x:.10g}" for x in row) for row in pose)
        blocks.append(f"{i} {j} {len(rotations)}\n{rows}\n")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(blocks))


# --- registration ------------------------------------------------------------------------------------


@pytest.mark.parametrize("folder", ["", "registration"])
def test_truth_of_fragments_follows_from_the_true_pairs(tmp_path: Path, folder: str) -> None:
    """Fragments 4 and 5 are joined to each other, but not to the rest; one estimate is wrong."""
    rotations = so3.random(np.random.default_rng(0), 6)
    scene = tmp_path / folder / "room-evaluation"  # as the authors' repository names it
    wrong = rotations.copy()
    wrong[3] = so3.exp(np.array([0, 0, np.pi / 2])) @ wrong[3]
    write_log(scene / "3dmatch.log", wrong, [(i, j) for i in range(6) for j in range(i + 1, 6)])
    write_log(scene / "gt.log", rotations, [(0, 1), (1, 2), (0, 2), (2, 3), (4, 5)])
    instance = load(Registration(scene="room"), tmp_path)
    assert instance.truth is not None
    assert np.isnan(instance.truth).all(axis=(1, 2)).nonzero()[0].tolist() == [4, 5]
    assert instance.notes == ("the truth of 2 of 6 fragments is unknown: gt.log does not connect them",)
    residuals = np.degrees(instance.problem.residuals(instance.truth))
    touching = (instance.problem.edges == 3).any(axis=1) & np.isfinite(residuals)
    np.testing.assert_allclose(residuals[touching], 90, atol=1e-6)
    np.testing.assert_allclose(residuals[np.isfinite(residuals) & ~touching], 0, atol=1e-6)


def test_fragments_without_true_pairs_are_not_scored(tmp_path: Path) -> None:
    write_log(tmp_path / "room" / "mine.log", TRUTH, [(0, 1), (1, 2)])
    instance = load(Registration(descriptor="mine"), tmp_path)
    assert (instance.truth, instance.name) == (None, "room-mine")
    assert "not scored" in instance.notes[-1]


def test_each_descriptor_has_its_published_scenes(tmp_path: Path) -> None:
    sources = list(Registration().sources(tmp_path, 0))
    assert len(sources) == 12
    assert all(source == Missing(source.name) for source in sources)
    of_fpfh = {source.name for source in Registration(descriptor="fpfh").sources(tmp_path, 0)}
    assert of_fpfh == {f"iclnuim-{room}-fpfh" for room in ("livingroom1", "livingroom2", "office1", "office2")}
    with pytest.raises(InputError, match=r"registration has no 'fphf\.log'; did you mean 'fpfh'"):
        list(Registration(descriptor="fphf").sources(tmp_path, 0))
    with pytest.raises(InputError, match="did you mean 'iclnuim-office1'"):
        list(Registration(scene="iclnuim-ofice1").sources(tmp_path, 0))


# --- scan-graph --------------------------------------------------------------------------------------


def scan_npz(path: Path) -> None:
    """A scene in single precision, with residuals that must not be taken for weights."""
    path.parent.mkdir(parents=True, exist_ok=True)
    sigma = np.linspace(0, 1, len(EDGES)).astype(np.float32)
    np.savez(path, n=N, edges=EDGES, rotations=MEASURED.astype(np.float32), sigma=sigma, truth=TRUTH)


def test_single_precision_is_no_fault_and_a_residual_no_weight(tmp_path: Path) -> None:
    scan_npz(tmp_path / "scannet_fgr" / "mine.npz")
    instance = load(ScanGraph(scene="mine"), tmp_path)
    assert instance.problem.carries == frozenset()
    rotations = instance.problem.rotations
    assert abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max() < 1e-14
    assert so3.angle_between(rotations, MEASURED).max() < 1e-6


@pytest.mark.parametrize("folder", ["redwood_fgr", "redwood/fgr"])
def test_a_published_summary_is_turned_into_our_convention(tmp_path: Path, folder: str) -> None:
    (tmp_path / folder).mkdir(parents=True)
    (tmp_path / folder / "00033.mat").write_bytes(mat(scan_summary()))
    for place in (tmp_path, tmp_path / folder):
        instance = load(ScanGraph("redwood", "00033"), place)
        assert instance.truth is not None
        assert so3.angle_between(instance.truth, TRUTH).max() < 1e-12
        assert instance.problem.residuals(instance.truth).max() < 1e-12
        assert instance.problem.m == N * (N - 1) // 2 - 1  # the pair that failed is no edge


def test_splits_are_the_authors(tmp_path: Path) -> None:
    scan_npz(tmp_path / "scannet_fgr" / "mine.npz")
    count = {split: len(list(ScanGraph(split=split).sources(tmp_path, 0))) for split in ("train", "test", "other")}  # type: ignore[arg-type]
    assert count == {"train": 40, "test": 20, "other": 92 + 1}
    assert len(list(ScanGraph("redwood", split="all").sources(tmp_path, 0))) == 58
    (known,) = ScanGraph(scene="scene0000_02").sources(tmp_path, 0)
    assert known == Missing("scene0000_02")
    assert isinstance(the_source(ScanGraph(scene="mine"), tmp_path), Source)


def test_a_summary_that_does_not_fit_together_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scannet_fgr").mkdir()
    path = tmp_path / "scannet_fgr" / "mine.mat"
    arrays = scan_summary()
    for change, why in (
        ({"sigma": np.zeros((2, 2))}, "T, Tstar and sigma must be 4n x 4n"),
        ({"sigma": np.full((N, N), 1e6)}, "no pair of scans is registered"),
        ({"T": -arrays["T"]}, "scans 0 and 1: the matrix is a reflection"),
    ):
        path.write_bytes(mat(arrays | change))
        with pytest.raises(InputError, match=f"mine.mat: {why}"):
            the_source(ScanGraph(scene="mine"), tmp_path).load()


# --- image-graph and anisotropic ---------------------------------------------------------------------


def test_counts_or_covariances_are_the_weights(tmp_path: Path) -> None:
    covariances = np.arange(1.0, len(EDGES) + 1)[:, None, None] * np.diag([1.0, 2, 3])
    gravity = np.tile([0.0, 0, -1], (N, 1))
    counts = np.arange(len(EDGES)) + 15
    arrays = {"n": N, "edges": EDGES, "rotations": MEASURED, "truth": TRUTH, "weights": counts}
    np.savez(tmp_path / "mine.npz", **arrays, covariances=covariances, gravity=gravity)
    scan_npz(tmp_path / "scan.npz")
    instance = load(ImageGraph("mine"), tmp_path)
    problem = instance.problem
    assert problem.carries == {"weights", "gravity"}
    assert problem.weights_kind == "count"
    assert problem.weights is not None
    np.testing.assert_array_equal(problem.weights, counts)
    other = load(ImageGraph("mine", "covariances"), tmp_path)
    assert (other.problem.weights_kind, other.problem.precisions) == ("precision", None)
    assert other.problem.weights is not None
    np.testing.assert_allclose(other.problem.weights, 1 / np.trace(covariances, axis1=1, axis2=2))
    assert other.revision != instance.revision
    with pytest.raises(InputError, match="no scene of image-graph 'scan'"):
        load(ImageGraph("scan"), tmp_path)
    np.savez(tmp_path / "mine.npz", **arrays)
    with pytest.raises(InputError, match=r"no positive 'covariances'.*choose weights=counts"):
        load(ImageGraph("mine", "covariances"), tmp_path)


def test_image_graphs_that_are_not_on_disk_say_that_a_folder_is_needed(tmp_path: Path) -> None:
    sources = list(ImageGraph().sources(tmp_path, 0))
    assert [source.name for source in sources] == ["castle-P30", "fountain-P11", "lego"]
    assert all(isinstance(source, Missing) and "--data-dir" in source.command for source in sources)


def test_hessians_become_precisions_in_the_first_frame(tmp_path: Path) -> None:
    (tmp_path / "anisotropic").mkdir()
    (tmp_path / "anisotropic" / "lu_sphinx.mat").write_bytes(mat(anisotropic_blocks()))
    instance = load(Anisotropic(), tmp_path)
    problem = instance.problem
    assert problem.precisions is not None
    assert problem.residuals(TRUTH).max() < 1e-12
    assert sorted(problem.edges.tolist()) == sorted(EDGES.tolist())
    for (i, _), rotation, precision in zip(problem.edges, problem.rotations, problem.precisions, strict=True):
        np.testing.assert_allclose(precision, rotation @ (np.diag([1.0, 2, 3]) + i) @ rotation.T, atol=1e-12)


# --- pose-graph --------------------------------------------------------------------------------------


def test_all_pose_graphs_of_a_folder(tmp_path: Path) -> None:
    (tmp_path / "pose_graphs").mkdir()
    for name in ("torus", "sphere2500", "garage"):
        (tmp_path / "pose_graphs" / f"{name}.g2o").write_text("EDGE_SE3:QUAT 4 7 0 0 0 0 0 0 1\n")
    assert [s.name for s in PoseGraph(None).sources(tmp_path, 0)] == ["sphere2500", "garage", "torus"]


# --- downloads ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PUBLISHED)
def test_what_is_published_is_listed_once_with_its_hash(name: str) -> None:
    listed = repository(name)
    assert len(listed.files) == PUBLISHED[name]
    assert len({here for _, here, _, _ in listed.files}) == len({sha for _, _, _, sha in listed.files}) + (
        name == "learning2sync"  # whose licence goes with both collections
    )
    assert all(len(sha) == 64 and size > 0 and ".." not in here for _, here, size, sha in listed.files)
    assert len(listed.commit) == 40


def served(server: Server) -> Repository:
    """A repository whose two logs are the same file."""
    data, sha = server.data, hashlib.sha256(server.data).hexdigest()
    names = ("3dmatch.log", "gt.log")
    files = [(f"data/room-evaluation/{name}", f"registration/room/{name}", len(data), sha) for name in names]
    address = f"http://127.0.0.1:{server.server_port}"
    return Repository("owner/name", "c0ffee", "MIT", "data", tuple(files), server=address)


@pytest.fixture
def logs(server: Server, tmp_path: Path) -> Server:
    write_log(tmp_path / "made.log", TRUTH, [(0, 1), (1, 2), (0, 2)])
    server.data = (tmp_path / "made.log").read_bytes()
    return server


def test_files_are_fetched_checked_and_read(
    logs: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("bench.datasets.registration.repository", lambda name: served(logs))
    scenes = Registration().fetch(tmp_path / "out")
    assert "100%" in capsys.readouterr().err
    assert logs.paths == [f"/owner/name/c0ffee/data/room-evaluation/{log}.log" for log in ("3dmatch", "gt")]
    assert scenes == tmp_path / "out" / "registration"
    assert Registration().verify(tmp_path / "out") == [("room", "ok")]
    assert load(Registration(), tmp_path / "out").problem.n == 3
    Registration().fetch(tmp_path / "out", progress=False)
    assert len(logs.asked) == 2  # what is there is not asked for again
    log = scenes / "room" / "gt.log"
    log.write_text(log.read_text().replace("0 2 4", "0 2 5"))
    (state,) = Registration().verify(tmp_path / "out")
    assert state == ("room", f"{log}: not as it was published; get it again with: data fetch registration")
    Registration().fetch(tmp_path / "out", progress=False)
    assert Registration().verify(tmp_path / "out") == [("room", "ok")]


def test_an_interrupted_file_goes_on_where_it_stopped(logs: Server, tmp_path: Path) -> None:
    logs.break_after = 100
    advice = r"100 of \d+ bytes are here; .* or clone https://github.com/owner/name and name its data with --data-dir"
    with pytest.raises(InputError, match=advice):
        served(logs).fetch(tmp_path, progress=False)
    logs.break_after = None
    served(logs).fetch(tmp_path, progress=False)
    assert logs.asked == [None, "bytes=100-", None]


def test_a_file_that_is_not_the_one_published_is_refused(logs: Server, tmp_path: Path) -> None:
    listed = served(logs)
    logs.data = logs.data.replace(b"0 2 4", b"0 2 5")
    with pytest.raises(InputError, match="its SHA-256 differs"):
        listed.fetch(tmp_path, progress=False)
    (tmp_path / "registration" / "room").rename(tmp_path / "aside")
    (tmp_path / "registration" / "room").write_text("a file where a folder should be")
    with pytest.raises(InputError, match="cannot be written"):
        listed.fetch(tmp_path, progress=False)


def test_every_fetchable_dataset_fetches_by_default_into_the_cache(
    logs: Server, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for dataset in (Registration(), ScanGraph(), Anisotropic()):
        with pytest.raises(InputError, match="is on disk; get"):
            dataset.verify(None)
        dataset.fetch(source=served(logs), progress=False)  # type: ignore[attr-defined]
    assert (elsewhere / "registration" / "room" / "gt.log").read_bytes() == logs.data
    assert repositories.GITHUB.startswith("https://")


# --- the real files ----------------------------------------------------------------------------------


@pytest.mark.real_data
def test_the_real_files_are_as_published_and_as_described(real_data: Path) -> None:
    """Shares of the edges within 10 degrees in each scene: mean, least and most, as the data's description has them."""
    assert all(state == "ok" for _, state in Registration().verify(real_data))
    scenes: dict[str, list[float]] = {}
    descriptors = ("3dmatch", "fpfh", "spin", "pcl_modified")
    for dataset in (ScanGraph("redwood"), *(Registration(descriptor=name) for name in descriptors)):
        for source in dataset.sources(real_data, 0):
            if isinstance(source, Source) and not source.name.startswith(("sun3d", "7-scenes")):
                instance = source.load()
                residuals = np.degrees(instance.problem.residuals(instance.truth))  # type: ignore[arg-type]
                scenes.setdefault(type(dataset).__name__, []).append(float((residuals < 10).mean()))
    found = {name: (np.mean(shares), min(shares), max(shares)) for name, shares in scenes.items()}
    assert found["ScanGraph"] == pytest.approx((0.29, 0.10, 0.61), abs=0.006)
    assert found["Registration"][1:] == pytest.approx((0.26, 0.56), abs=0.006)
    for dataset, limit, share in ((ImageGraph("castle-P30"), 5, 0.65), (Anisotropic(), 1.32, 0.90)):
        instance = load(dataset, real_data)
        residuals = np.degrees(instance.problem.residuals(instance.truth))  # type: ignore[arg-type]
        assert (residuals < limit).mean() == pytest.approx(share, abs=0.006)


def errors_of(method: str, source: Source, *, counts: bool = False) -> dict[str, float]:
    """Of a method that is given match counts, or nothing but the rotations."""
    instance = source.load()
    problem, weights = instance.problem, instance.problem.weights if counts else None
    estimate = bench.solve(problem.edges, problem.rotations, method, weights, problem.n, weights_kind="count")
    return bench.score(estimate, instance.truth)  # type: ignore[arg-type]


@pytest.mark.real_data
def test_the_real_graphs_have_the_difficulty_that_was_measured_elsewhere(real_data: Path) -> None:
    """Figures of the data's description, of methods without counts."""
    for scene, mean, share in (("castle-P30", 26.0, 0.70), ("lego", 44.4, 0.75)):
        found = errors_of("l1-irls[init=spectral]", the_source(ImageGraph(scene), real_data))
        assert (found["mean_deg"], found["within_10_deg"]) == pytest.approx((mean, share), abs=0.05)
    shares = [
        errors_of("cemp", source)["within_10_deg"]
        for descriptor in ("3dmatch", "fpfh", "spin", "pcl_modified")
        for source in Registration(descriptor=descriptor).sources(real_data, 0)
        if isinstance(source, Source) and source.name.startswith("iclnuim")
    ]
    assert len(shares) == 12
    assert np.mean(shares) == pytest.approx(0.28, abs=0.005)


@pytest.mark.real_data
def test_counts_are_what_solves_repeated_structure(real_data: Path) -> None:
    source = the_source(ImageGraph("lego"), real_data)
    assert errors_of("l1-irls[init=spanning-tree]", source, counts=True)["within_10_deg"] == 1
    assert errors_of("l1-irls[init=spanning-tree]", source)["within_10_deg"] < 0.8
