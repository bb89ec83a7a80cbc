"""Absolute rotations: what is written is read back, and truth is read as its format means it."""

from pathlib import Path

import numpy as np
import pytest
from format_seeds import database
from scenes import bundle_camera, write_scene
from scipy.spatial.transform import Rotation

from bench.core import so3
from bench.core.errors import InputError
from bench.formats import holds, known_formats, read_graph, read_rotations, rotations_writer

TRUTH = so3.random(np.random.default_rng(8), 5)
CAMERAS = np.array([3, 4, 7, 9, 12])


@pytest.mark.parametrize("name", ["out.npz", "out.txt", "out.csv", "out.tum", "images.txt", "model"])
def test_what_is_written_is_read_back(tmp_path: Path, name: str) -> None:
    if name == "model":
        pytest.importorskip("pycolmap")
    rotations = TRUTH.copy()
    rotations[2] = np.nan
    extras = {
        "edge_weights": np.ones(4),
        "residuals": np.zeros(4),
        "edges": np.ones((4, 2), int),
        "stop_reason": "done",
    }
    rotations_writer(tmp_path / name)(CAMERAS, rotations, extras)
    found = read_rotations(tmp_path / name)
    kept = found.cameras.tolist()
    assert kept in (CAMERAS.tolist(), [3, 4, 9, 12])
    expected = rotations[np.isin(CAMERAS, kept)]
    np.testing.assert_allclose(found.rotations, expected, atol=1e-12)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_an_archive_keeps_what_the_method_says_without_pickle(tmp_path: Path) -> None:
    rotations_writer(tmp_path / "out.npz")(CAMERAS, TRUTH, {"edge_weights": np.arange(3.0), "stop_reason": "converged"})
    with np.load(tmp_path / "out.npz", allow_pickle=False) as archive:
        assert str(archive["stop_reason"]) == "converged"
        assert archive["edge_weights"].tolist() == [0, 1, 2]
    with pytest.raises(InputError, match="there is no array 'edges'"):
        read_graph(tmp_path / "out.npz")


def test_a_pose_graph_needs_one_to_be_written(tmp_path: Path) -> None:
    np.savez(tmp_path / "graph.npz", edges=[[0, 1]], rotations=TRUTH[:1])
    with pytest.raises(InputError, match="a pose graph is written from a pose graph"):
        rotations_writer(tmp_path / "out.g2o", read_graph(tmp_path / "graph.npz"))


def test_trajectories_are_camera_to_world(tmp_path: Path) -> None:
    """Both as scipy turns vectors, which knows nothing of this project."""
    poses = Rotation.from_matrix(TRUTH.transpose(0, 2, 1))
    tum, kitti = tmp_path / "a.txt", tmp_path / "b.txt"
    times = [0.5, 1.25, 2, 3, 1e9]
    lines = [" ".join(map(str, [t, 1, 2, 3, *q])) for t, q in zip(times, poses.as_quat().tolist(), strict=True)]
    tum.write_text("# timestamp tx ty tz qx qy qz qw\n" + "\n".join(lines))
    kitti.write_text("\n".join(" ".join(map(str, np.column_stack([r, [1, 2, 3]]).ravel())) for r in poses.as_matrix()))
    for path in (tum, kitti):
        found = read_rotations(path)
        assert found.cameras.tolist() == list(range(5))
        np.testing.assert_allclose(found.rotations, TRUTH, atol=1e-12)
    assert read_rotations(tum).names == ("0.5", "1.25", "2.0", "3.0", "1000000000.0")
    with pytest.raises(InputError, match=r"this is kitti .* holds no graph of relative rotations"):
        read_graph(kitti)


def test_cameras_of_a_bundle_without_focal_length_are_not_registered(tmp_path: Path) -> None:
    path = tmp_path / "gt_bundle.out"
    cameras = [bundle_camera(TRUTH[0]), bundle_camera(np.eye(3)).replace("1000.5", "0"), bundle_camera(TRUTH[1])]
    cameras.append(bundle_camera(2 * np.eye(3)).replace("1000.5", "0"))
    path.write_text(f"# Bundle file v0.3\n4 0\n{''.join(cameras)}")
    found = read_rotations(path).rotations
    assert np.isnan(found).all(axis=(1, 2)).tolist() == [False, True, False, True]
    np.testing.assert_allclose(found[2], TRUTH[1], atol=1e-12)


def test_truth_is_found_by_name_or_by_id(tmp_path: Path) -> None:
    rotations = write_scene(tmp_path / "scene", images=9)
    graph = read_graph(tmp_path / "scene")
    truth = read_rotations(tmp_path / "scene").of(graph)
    known = np.isfinite(truth).all(axis=(1, 2))
    assert known.tolist() == [camera != 2 for camera in graph.cameras]
    np.testing.assert_allclose(truth[known], rotations[graph.cameras][known], atol=1e-9)
    np.savez(tmp_path / "graph.npz", edges=[[0, 1], [1, 2]], rotations=TRUTH[:2], names=["a", "b", "c"], n=3)
    np.savez(tmp_path / "truth.npz", rotations=TRUTH, names=["c", "x", "a", "y", "z"])
    found = read_rotations(tmp_path / "truth.npz").of(read_graph(tmp_path / "graph.npz"))
    np.testing.assert_allclose(found, [TRUTH[2], np.full((3, 3), np.nan), TRUTH[0]], atol=1e-12)


def test_a_graph_with_its_truth_is_one_file(tmp_path: Path) -> None:
    np.savez(tmp_path / "graph.npz", edges=[[0, 1]], rotations=[TRUTH[0] @ TRUTH[1].T], truth=TRUTH[:2])
    found = read_rotations(tmp_path / "graph.npz").of(read_graph(tmp_path / "graph.npz"))
    np.testing.assert_allclose(found, TRUTH[:2], atol=1e-12)


def test_precisions_of_an_archive_are_turned_with_their_edge(tmp_path: Path) -> None:
    precision = np.diag([1.0, 2, 3])
    both = {"edges": [[0, 1], [2, 1]], "rotations": TRUTH[:2]}
    for name, value in (("precisions", precision), ("hessians", precision), ("covariances", np.linalg.inv(precision))):
        np.savez(tmp_path / "graph.npz", **both, **{name: np.stack([value, value])}, num_matches=[5, 6])
        problem = read_graph(tmp_path / "graph.npz").problem
        assert problem.precisions is not None
        np.testing.assert_allclose(problem.precisions[0], precision, atol=1e-12)
        np.testing.assert_allclose(problem.precisions[1], TRUTH[1].T @ precision @ TRUTH[1], atol=1e-12)
        assert problem.weights is not None
        assert (problem.weights.tolist(), problem.weights_kind) == ([5, 6], "count")
    np.savez(tmp_path / "graph.npz", **both, weights=[0.5, 2], weights_kind="precision", gravity=np.eye(3) * 2)
    problem = read_graph(tmp_path / "graph.npz").problem
    assert problem.weights_kind == "precision"
    np.testing.assert_array_equal(problem.gravity, np.eye(3))


def test_every_format_says_what_it_is() -> None:
    formats = known_formats()
    assert len({form.name for form in formats}) == len(formats)
    for form in formats:
        assert form.summary
        assert form.hints
        assert form.graph or form.rotations


# --- a file of one kind is never taken for another ---------------------------------------------------


def test_content_decides_whatever_the_name(tmp_path: Path) -> None:
    """Every text format under the name of every other."""
    identity = " ".join(map(str, np.eye(3).ravel().astype(int)))
    contents = {
        "egs": f"0 1 {identity} 0 0 0\n",
        "g2o": "EDGE_SE2 0 1 1 2 0.5\n",
        "relative-poses": "a.jpg b.jpg 1 0 0 0 1 2 3\n",
        "log": "0 1 2\n1 0 0 4\n0 1 0 5\n0 0 1 6\n0 0 0 1\n",
        "open3d": '{"class_name": "PoseGraph", "nodes": [{}, {}], "edges": [{"source_node_id": 0, "target_node_id": 1, '
        '"transformation": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}]}',
    }
    for content in contents.values():
        for name in ("EGs.txt", "graph.g2o", "relpose.txt", "x.log", "x.json", "x.mat", "x.npz", "database.db", "x"):
            (tmp_path / name).write_text(content)
            assert contents[read_graph(tmp_path / name).format] == content
    truths = {
        f"0 {identity}\n1 {identity}\n": "rotations",
        f"camera,r11,r12,r13,r21,r22,r23,r31,r32,r33\n0,{identity.replace(' ', ',')}\n": "csv",
        "0 1 2 3 0 0 0 1\n": "tum",
        "1 0 0 4 0 1 0 5 0 0 1 6\n": "kitti",
        "1 1 0 0 0 0 0 0 1 a.jpg\n1 2 -1\n": "colmap-images",
    }
    for content, kind in truths.items():
        (tmp_path / "truth.dat").write_text(content)
        assert (read_rotations(tmp_path / "truth.dat").rotations == np.eye(3)).all()
        with pytest.raises(InputError, match=f"this is {kind} "):
            read_graph(tmp_path / "truth.dat")


def test_a_database_of_colmap_is_no_file_of_rotations(tmp_path: Path) -> None:
    """Its tables have columns of the names that ``images.txt`` explains."""
    (tmp_path / "database.db").write_bytes(database())
    assert holds(tmp_path / "database.db") == {"graph"}
