"""Files that other programs write, made here by those programs or by hand from their documentation."""

import json
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Floats
from bench.formats import GraphFile, read_graph, read_rotations, rotations_writer

N = 6
TRUTH = so3.random(np.random.default_rng(21), N)
PAIRS = [(i, j) for i in range(N) for j in range(i + 1, N)] + [(4, 1), (0, 1)]


def relative(i: int, j: int) -> Floats:
    return TRUTH[i] @ TRUTH[j].T


def worst_deg(graph: GraphFile, truth: Floats = TRUTH) -> float:
    return float(np.degrees(graph.problem.residuals(truth)).max())


# --- COLMAP's database -------------------------------------------------------------------------------


@pytest.fixture
def database(tmp_path: Path) -> Path:
    """A database and its reconstruction, made by pycolmap from synthetic images."""
    pycolmap = pytest.importorskip("pycolmap")
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_frames_per_rig=7, num_points3D=60, two_view_geometry_has_relative_pose=True, prior_gravity=True
    )
    pycolmap.set_random_seed(3)
    (tmp_path / "model").mkdir()
    with pycolmap.Database.open(tmp_path / "database.db") as made:
        pycolmap.synthesize_dataset(options, made).write_text(tmp_path / "model")
    return tmp_path / "database.db"


def execute(path: Path, *commands: str) -> None:
    with sqlite3.connect(path) as connection:
        for command in commands:
            connection.execute(command)
    connection.close()


def test_a_database_goes_in_and_a_reconstruction_comes_out(database: Path, tmp_path: Path) -> None:
    import pycolmap

    from bench.methods.spectral import Spectral

    graph = read_graph(database)
    model = pycolmap.Reconstruction(tmp_path / "model")
    images = {image.image_id: image for image in model.images.values()}
    truth = np.array([images[k].cam_from_world().rotation.matrix() for k in graph.cameras.tolist()])
    assert graph.names == tuple(images[k].name for k in graph.cameras.tolist())
    assert graph.problem.n == 7
    assert graph.problem.m == 21
    assert worst_deg(graph, truth) < 1e-6
    down = np.array([images[k].cam_from_world().rotation * np.array([0.0, 1, 0]) for k in graph.cameras.tolist()])
    assert graph.problem.gravity is not None
    np.testing.assert_allclose(graph.problem.gravity, down, atol=1e-9)
    assert graph.problem.weights_kind == "count"
    assert graph.problem.weights is not None
    with pycolmap.Database.open(database) as made:
        inliers = [
            len(made.read_two_view_geometry(*graph.cameras[edge].tolist()).inlier_matches)
            for edge in graph.problem.edges
        ]
    assert graph.problem.weights.tolist() == inliers

    estimate = Spectral().solve(graph.problem, np.random.default_rng(0))
    solved = estimate.rotations @ (estimate.rotations[0].T @ truth[0])
    rotations_writer(tmp_path / "out", graph)(graph.cameras, solved, {})
    out = pycolmap.Reconstruction(tmp_path / "out")
    assert out.num_reg_images() == 7
    assert {c.camera_id: c.params.tolist() for c in out.cameras.values()} == {
        c.camera_id: c.params.tolist() for c in model.cameras.values()
    }
    for k, rotation in zip(graph.cameras.tolist(), truth, strict=True):
        assert out.image(k).name == images[k].name
        np.testing.assert_allclose(out.image(k).cam_from_world().rotation.matrix(), rotation, atol=1e-6)


def test_pairs_that_say_nothing_are_left_out_and_counted(database: Path) -> None:
    ids = "IN (SELECT pair_id FROM two_view_geometries ORDER BY pair_id LIMIT 1 OFFSET {})"
    execute(
        database,
        f"UPDATE two_view_geometries SET config = 1 WHERE pair_id {ids.format(0)}",
        f"UPDATE two_view_geometries SET config = 7 WHERE pair_id {ids.format(1)}",
        f"UPDATE two_view_geometries SET rows = 0 WHERE pair_id {ids.format(2)}",
        f"UPDATE two_view_geometries SET qvec = NULL WHERE pair_id {ids.format(3)}",
        "UPDATE pose_priors SET gravity = NULL WHERE corr_data_id = 2",
    )
    graph = read_graph(database)
    assert graph.problem.m == 17
    assert graph.notes == (
        "1 pairs with the geometry degenerate are left out",
        "1 pairs with the geometry watermark are left out",
        "1 pairs without inlier matches are left out",
        "1 pairs without a relative pose are left out",
    )
    assert graph.problem.gravity is not None
    assert np.isnan(graph.problem.gravity).all(axis=1).tolist() == [k == 2 for k in graph.cameras]


def test_a_database_without_poses_names_the_call_that_makes_them(database: Path) -> None:
    import pycolmap

    old = (
        np.array([1.0, 0, 0, 0]).tobytes().hex(),
        np.zeros(3).tobytes().hex(),
    )  # what COLMAP wrote before it wrote NULL
    execute(database, f"UPDATE two_view_geometries SET qvec = x'{old[0]}', tvec = x'{old[1]}'")
    with pytest.raises(InputError, match=r"21 pairs without a relative pose.*pycolmap\.geometric_verification\(path"):
        read_graph(database)
    with pycolmap.Database.open(database) as made:
        made.clear_two_view_geometries()
    pycolmap.geometric_verification(database, two_view_geometry_options={"compute_relative_pose": True})
    graph = read_graph(database)
    assert np.degrees(graph.problem.residuals(read_rotations(database.parent / "model").of(graph))).max() < 0.1


def test_another_database_is_refused(tmp_path: Path) -> None:
    execute(tmp_path / "other.db", "CREATE TABLE x (y)", "INSERT INTO x VALUES (1)")
    with pytest.raises(InputError, match="no table of two-view geometries"):
        read_graph(tmp_path / "other.db")


# --- COLMAP's reconstructions ------------------------------------------------------------------------


def test_reconstructions_are_read_as_pycolmap_reads_them(database: Path, tmp_path: Path) -> None:
    import pycolmap

    model = pycolmap.Reconstruction(tmp_path / "model")
    (tmp_path / "binary").mkdir()
    model.write(tmp_path / "binary")
    for path in ("model", "model/images.txt", "binary", "binary/images.bin"):
        found = read_rotations(tmp_path / path)
        assert found.names is not None
        assert len(found.cameras) == 7
        for camera, name, rotation in zip(found.cameras.tolist(), found.names, found.rotations, strict=True):
            assert model.image(camera).name == name
            np.testing.assert_allclose(model.image(camera).cam_from_world().rotation.matrix(), rotation, atol=1e-12)


def test_images_txt_goes_into_pycolmap(tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    rotations = TRUTH.copy()
    rotations[1] = np.nan
    rotations_writer(tmp_path / "images.txt")(np.arange(1, N + 1), rotations, {})
    (tmp_path / "cameras.txt").write_text("1 SIMPLE_PINHOLE 100 100 50 50 50\n")
    (tmp_path / "points3D.txt").write_text("")
    model = pycolmap.Reconstruction(tmp_path)
    assert sorted(model.images) == [1, 3, 4, 5, 6]
    np.testing.assert_allclose(model.image(4).cam_from_world().rotation.matrix(), TRUTH[3], atol=1e-9)
    assert model.image(4).name == "4"


def test_names_of_images_may_hold_anything(tmp_path: Path) -> None:
    path = tmp_path / "whatever.txt"
    lines = [
        f"{k + 1} 1 0 0 0 0 0 0 1 {name}\n1.5 2.5 -1 3 4 5\n" for k, name in enumerate(["a b.jpg", "#1.jpg", "ü.png"])
    ]
    path.write_text("".join(lines), encoding="utf-8")
    assert read_rotations(path).names == ("a b.jpg", "#1.jpg", "ü.png")


# --- relative poses, logs, Open3D, MATLAB ------------------------------------------------------------


def test_relative_poses_are_those_of_pycolmap(tmp_path: Path) -> None:
    """A point of the first frame is taken into the second by the pose that is written."""
    pycolmap = pytest.importorskip("pycolmap")
    lines = []
    for i, j in PAIRS:
        first, second = (pycolmap.Rigid3d(pycolmap.Rotation3d(TRUTH[k].copy()), np.ones(3) * k) for k in (i, j))
        pose = second * first.inverse()
        x, y, z, w = pose.rotation.quat
        lines.append(f"cam#{i} cam#{j} " + " ".join(f"{number:.17g}" for number in (w, x, y, z, *pose.translation)))
    path = tmp_path / "pairs.txt"
    path.write_text("# pairs\n" + "\n".join(lines))
    graph = read_graph(path)
    assert graph.names == tuple(f"cam#{k}" for k in range(N))
    assert graph.problem.m == len(PAIRS)
    assert worst_deg(graph) < 1e-10


def log_text(blocks: list[tuple[int, int, Floats]]) -> str:
    return "".join(
        f"{i}\t{j}\t{N}\n" + "".join(" ".join(f"{x:.17g}" for x in row) + "\n" for row in matrix)
        for i, j, matrix in blocks
    )


def pose(rotation: Floats) -> Floats:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, [1.5, 2, 3]
    return matrix


def test_a_log_takes_fragment_j_into_fragment_i(tmp_path: Path) -> None:
    path = tmp_path / "result.log"
    path.write_text(log_text([(i, j, pose(relative(i, j))) for i, j in PAIRS]))
    graph = read_graph(path)
    assert graph.problem.m == len(PAIRS)
    assert worst_deg(graph) < 1e-10
    truth = read_rotations(path)
    assert worst_deg(graph, truth.of(graph)) < 1e-10
    assert truth.notes == (f"chained from {len(PAIRS)} relative poses",)


def test_a_trajectory_in_a_log_is_fragment_to_world(tmp_path: Path) -> None:
    path = tmp_path / "trajectory.log"
    path.write_text(log_text([(k, k, pose(TRUTH[k].T)) for k in range(N)]).replace(f"\t{N}\n", f"\t{N + 1}\n"))
    np.testing.assert_allclose(read_rotations(path).rotations, TRUTH, atol=1e-12)
    with pytest.raises(InputError, match="a trajectory, not a graph"):
        read_graph(path)


def test_information_beside_a_log_is_of_the_quaternion_in_frame_j(tmp_path: Path) -> None:
    """A cost as the evaluation of Redwood computes it: (t, vector of the quaternion) of T^-1 T', here without t."""
    rng = np.random.default_rng(2)
    factors = rng.standard_normal((len(PAIRS), 6, 9))
    information = factors @ factors.transpose(0, 2, 1)
    information[:, :3, 3:] = 0
    information[:, 3:, :3] = 0
    path = tmp_path / "result.log"
    path.write_text(log_text([(i, j, pose(relative(i, j))) for i, j in PAIRS]))
    (tmp_path / "result.info").write_text(log_text([(i, j, a) for (i, j), a in zip(PAIRS, information, strict=True)]))
    precisions = read_graph(path).problem.precisions
    assert precisions is not None
    for row, (i, j) in enumerate(PAIRS):
        d = 1e-4 * rng.standard_normal(3)
        error = so3.to_quaternion(relative(i, j).T @ so3.exp(-d) @ relative(i, j))[1:]
        ours = d if i < j else -relative(i, j).T @ d
        assert ours @ precisions[row] @ ours == pytest.approx(error @ information[row, 3:, 3:] @ error, rel=1e-3)
    (tmp_path / "result.info").write_text(log_text([(0, 1, information[0])]))
    with pytest.raises(InputError, match=r"result\.info: the pairs are not those of result\.log"):
        read_graph(path)


def open3d_graph(information: list[Floats] | None = None) -> dict[str, object]:
    """What `open3d.io.write_pose_graph` writes: matrices column by column."""
    edges = []
    for row, (target, source) in enumerate(PAIRS):
        edge = {"class_name": "PoseGraphEdge", "source_node_id": source, "target_node_id": target, "confidence": 1.0}
        edge["transformation"] = pose(relative(target, source)).T.ravel().tolist()
        edge["information"] = (np.eye(6) if information is None else information[row]).T.ravel().tolist()
        edges.append(edge)
    nodes = [{"class_name": "PoseGraphNode", "pose": np.eye(4).ravel().tolist()} for _ in range(N + 1)]
    return {"class_name": "PoseGraph", "version_major": 1, "version_minor": 0, "nodes": nodes, "edges": edges}


def test_open3d_takes_the_source_into_the_target(tmp_path: Path) -> None:
    path = tmp_path / "graph.txt"
    path.write_text(json.dumps(open3d_graph(), indent="\t"))
    graph = read_graph(path)
    assert graph.format == "open3d"
    assert graph.problem.n == N + 1
    assert worst_deg(graph, np.concatenate([TRUTH, np.eye(3)[None]])) < 1e-10


def test_open3d_information_is_of_the_rotation_of_target_points(tmp_path: Path) -> None:
    """Squared distances of matched points, least over the translation, grow by d^T P d with a rotation d of frame i."""
    rng = np.random.default_rng(3)
    clouds = [rng.standard_normal((20, 3)) * [1, 2, 5] + 3 for _ in PAIRS]
    information = []
    for points in clouds:
        rows = np.concatenate([-so3.hat(points), np.broadcast_to(np.eye(3), (20, 3, 3))], axis=2).reshape(-1, 6)
        information.append(rows.T @ rows)
    path = tmp_path / "graph.json"
    path.write_text(json.dumps(open3d_graph(information)))
    precisions = read_graph(path).problem.precisions
    assert precisions is not None
    for row, (i, j) in enumerate(PAIRS):
        d = 1e-4 * rng.standard_normal(3)
        moved = clouds[row] @ so3.exp(d).T - clouds[row]
        least = ((moved - moved.mean(axis=0)) ** 2).sum()
        ours = d if i < j else -relative(i, j).T @ d
        assert ours @ precisions[row] @ ours == pytest.approx(least, rel=1e-3)


@pytest.mark.parametrize("compressed", [True, False])
def test_matlab_has_the_transpose_and_counts_from_one(tmp_path: Path, compressed: bool) -> None:
    """RR(:,:,k) R_i = R_j for I(:,k) = [i; j], as Chatterjee and Govindu's code has it."""
    stacked = np.stack([TRUTH[j] @ TRUTH[i].T for i, j in PAIRS], axis=2)
    path = tmp_path / "graph.mat"
    savemat(path, {"RR": stacked, "I": np.array(PAIRS).T + 1.0, "other": {"a": [1]}}, do_compression=compressed)
    graph = read_graph(path)
    assert graph.cameras.tolist() == list(range(1, N + 1))
    assert worst_deg(graph) < 1e-10
    savemat(path, {"RR": stacked[:, :, 0], "I": np.array([[1], [2]], np.uint8)}, do_compression=compressed)
    np.testing.assert_allclose(read_graph(path).problem.rotations, [relative(0, 1)], atol=1e-12)


BAD_MATLAB = {
    "there is no array of numbers 'I'": {"RR": np.eye(3)},
    "RR must be 3 x 3 x m and I 2 x m": {"RR": np.ones((3, 3, 2)), "I": np.ones((2, 3))},
    "'I' must hold the numbers of cameras, from 1": {"RR": np.eye(3), "I": np.array([[0], [1]])},
    "column 1 of I: the matrix is a reflection": {"RR": -np.eye(3), "I": np.array([[1], [2]])},
}


@pytest.mark.parametrize("why", BAD_MATLAB)
def test_a_bad_matlab_file_is_refused(tmp_path: Path, why: str) -> None:
    savemat(tmp_path / "graph.mat", BAD_MATLAB[why])
    with pytest.raises(InputError, match=f"graph.mat: {why}"):
        read_graph(tmp_path / "graph.mat")
    (tmp_path / "graph.mat").write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64")
    with pytest.raises(InputError, match=r"save\(\.\.\., '-v7'\)"):
        read_graph(tmp_path / "graph.mat")
