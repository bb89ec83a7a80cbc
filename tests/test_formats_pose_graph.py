"""Pose graphs as the programs write them: what is read, left out and noted, and what information matrices mean."""

from pathlib import Path

import numpy as np
import pytest

from bench.core import so3
from bench.core.problem import Floats
from bench.formats import read_graph, rotations_writer
from bench.formats.information import marginal

PAIRS = [(0, 1), (1, 2), (2, 3), (3, 4), (0, 3), (4, 1), (0, 2)]
POSES = so3.random(np.random.default_rng(11), 5)  # body to world


def quaternion(rotation: Floats, scale: float = 1.0) -> str:
    w, x, y, z = scale * so3.to_quaternion(rotation)
    return f"{x:.17g} {y:.17g} {z:.17g} {w:.17g}"


def edge(i: int, j: int, rest: str = "", tag: str = "EDGE_SE3:QUAT", extra: str = "", scale: float = 1.0) -> str:
    return f"{tag} {i} {j}{extra} 1 2 3 {quaternion(POSES[i].T @ POSES[j], scale)}{rest}"


def written(folder: Path, *lines: str, name: str = "graph.g2o") -> Path:
    path = folder / name
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def upper(matrix: Floats) -> str:
    return "".join(f" {x:.17g}" for x in matrix[np.triu_indices(len(matrix))])


def worst(path: Path) -> float:
    graph = read_graph(path)
    return float(graph.problem.residuals(np.swapaxes(POSES[graph.cameras], 1, 2)).max())


def test_what_holds_no_pose_is_left_out_and_counted(tmp_path: Path) -> None:
    """g2o's own, vertigo's, RTAB-Map's and hdl_graph_slam's."""
    others = [
        *["PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1", "FIX 0", "VERTEX_SWITCH 9 1", "EDGE_SWITCH_PRIOR 9 1 1.0"],
        *["EDGE_POINTXYZ_PRIOR 0 1 2 3 1 0 0 1 0 1", "EDGE_SE3_PRIORXYZ 0 1 2 3 1 0 0 1 0 1"] * 2,
        *["VERTEX_PLANE 7 0 0 1 2 0 0 0", "EDGE_SE3_PLANE 0 7 0 0 1 2 1 0 0 1 0 1", "EDGE_PLANE_PARALLEL 7 8 0 0 0"],
        *["EDGE_SE3_PRIORQUAT 0 0 0 0 1 1 0 0 1 0 1", "EDGE_SE3_PRIORVEC 0 0 0 1 0 0 1 1 0 0 1 0 1", "VERTEX_TAG 0 1"],
    ]
    path = written(tmp_path, *others, *(edge(i, j) for i, j in PAIRS))
    assert worst(path) < 1e-12
    notes = read_graph(path).notes
    assert "2 EDGE_SE3_PRIORXYZ lines are left out" in notes
    assert len(notes) == len({line.split()[0] for line in others})


@pytest.mark.parametrize("tag", ["EDGE_SE3_SWITCHABLE", "EDGE_SE3_MAXMIX"])
def test_switchable_edges_are_measurements(tmp_path: Path, tag: str) -> None:
    ones = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1"
    path = written(
        tmp_path, *(edge(i, j, ones) for i, j in PAIRS[:3]), *(edge(i, j, ones, tag, " 77") for i, j in PAIRS[3:])
    )
    assert read_graph(path).problem.m == len(PAIRS)
    assert worst(path) < 1e-12


def test_comments_names_and_numbers_as_programs_write_them(tmp_path: Path) -> None:
    lines = [
        "\ufeff# Städtchen",
        "VERTEX_SE3:QUAT 0 -nan(ind) nan(ind) 1.#QNAN 0 0 0 1 # être",
        *map(str.strip, "\n\n"),
    ]
    lines += [f"VERTEX_SE3:QUAT {k} 0 0 0 0 0 0 1" for k in range(1, 5)]
    lines += [edge(i, j).replace(" 1 2 3 ", " -nan nan(0x7) -1.#IND00 ") + "  # loop closure" for i, j in PAIRS]
    lines[-1] = lines[-1].replace("  # loop", "#loop")
    assert worst(written(tmp_path, *lines)) < 1e-12


def test_quaternions_are_normalised_and_noted(tmp_path: Path) -> None:
    path = written(tmp_path, *(edge(i, j, scale=1.03 if i == 0 else 1) for i, j in PAIRS))
    assert worst(path) < 1e-12
    assert read_graph(path).notes == ("3 of 7 quaternions are up to 3.0 % off norm 1: normalised",)


def test_a_pair_may_be_measured_again_from_either_end(tmp_path: Path) -> None:
    graph = read_graph(written(tmp_path, *(edge(i, j) for i, j in [*PAIRS, (1, 0), (0, 1)])))
    assert graph.problem.m == 9
    assert graph.problem.has_parallel_edges


@pytest.mark.parametrize("name", ["graph.txt", "graph", "graph.docx"])
def test_the_name_does_not_matter(tmp_path: Path, name: str) -> None:
    path = written(tmp_path, *(edge(i, j) for i, j in PAIRS), name=name)
    assert read_graph(path).format == "g2o"
    assert worst(path) < 1e-12


# --- the plane ---------------------------------------------------------------------------------------

HEADINGS = np.array([0.3, 2.9, -3.0, 1.2, -0.4])
PLANAR = {
    "g2o": ("VERTEX_SE2", "EDGE_SE2", [2.0, 0.5, 0.1, 3.0, 0.2, 7.0]),  # xx xy xt yy yt tt
    "toro": ("VERTEX2", "EDGE2", [2.0, 0.5, 3.0, 7.0, 0.1, 0.2]),  # xx xy yy tt xt yt
}


@pytest.mark.parametrize("kind", PLANAR)
def test_headings_are_rotations_about_z(tmp_path: Path, kind: str) -> None:
    vertex, tag, numbers = PLANAR[kind]
    lines = [f"{vertex} {k} 0 0 {angle!r}" for k, angle in enumerate(HEADINGS.tolist())]
    for i, j in PAIRS:
        scale = 4.0 if (i, j) == (0, 1) else 1.0
        information = " ".join(f"{scale * x!r}" for x in numbers)
        lines.append(f"{tag} {i} {j} 1 0 {HEADINGS[j] - HEADINGS[i]:.17g} {information}")
    graph = read_graph(written(tmp_path, *lines))
    truth = so3.exp(-HEADINGS[:, None] * np.array([0, 0, 1.0]))  # world to body
    assert graph.problem.residuals(truth).max() < 1e-12
    full = np.array([[2.0, 0.5, 0.1], [0.5, 3.0, 0.2], [0.1, 0.2, 7.0]])
    expected = 1 / np.linalg.inv(full)[2, 2]
    assert graph.problem.precisions is not None
    np.testing.assert_allclose(graph.problem.precisions[0], 4 * expected * np.eye(3), rtol=1e-12)
    np.testing.assert_allclose(graph.problem.precisions[1], expected * np.eye(3), rtol=1e-12)


# --- information -------------------------------------------------------------------------------------


def random_information(rng: np.random.Generator) -> Floats:
    a = rng.standard_normal((6, 8))
    return a @ a.T


def cost_of_g2o(information: Floats, measured: Floats, true: Floats, translation: Floats) -> float:
    """The error of g2o (translation, rotation vector) of Z^-1 X, X and Z at the same place but for `translation`."""
    error = np.concatenate([measured.T @ translation, so3.log(measured.T @ true)])
    return float(error @ information @ error)


def scaled_cost(translation: Floats, information: Floats, measured: Floats, true: Floats) -> float:
    return 1e6 * cost_of_g2o(information, measured, true, 1e-3 * translation)


def test_a_precision_is_the_least_cost_of_a_small_rotation_in_frame_i(tmp_path: Path) -> None:
    """d^T P d, with R_ij = exp(d) R_i R_j^T, against the cost of the whole error at the best translation."""
    from scipy.optimize import minimize

    rng = np.random.default_rng(4)
    informations = [random_information(rng) for _ in PAIRS]
    graph = read_graph(
        written(tmp_path, *(edge(i, j, upper(info)) for (i, j), info in zip(PAIRS, informations, strict=True)))
    )
    precisions = graph.problem.precisions
    assert precisions is not None
    for row, ((i, j), information) in enumerate(zip(PAIRS, informations, strict=True)):
        measured = POSES[i].T @ POSES[j]
        d = 1e-3 * rng.standard_normal(3)
        true = so3.exp(-d) @ measured  # R_ij = exp(d) R_i R_j^T
        best = minimize(scaled_cost, np.zeros(3), (information, measured, true))
        ours = d if i < j else -measured.T @ d  # of the edge as it is kept, with i < j
        assert ours @ precisions[row] @ ours == pytest.approx(1e-6 * best.fun, rel=2e-3)


def test_gtsam_reads_the_same_rotations_and_precisions(tmp_path: Path) -> None:
    import gtsam

    rng = np.random.default_rng(5)
    lines = [f"VERTEX_SE3:QUAT {k} 0 0 0 {quaternion(pose)}" for k, pose in enumerate(POSES)]
    path = written(tmp_path, *lines, *(edge(i, j, upper(random_information(rng))) for i, j in PAIRS))
    problem = read_graph(path).problem
    assert problem.precisions is not None
    factors, _ = gtsam.readG2o(str(path), True)
    assert factors.size() == problem.m
    for row in range(problem.m):
        factor = factors.at(row)
        i, j = factor.keys()
        rotation = factor.measured().rotation().matrix()
        covariance = factor.noiseModel().covariance()[:3, :3]  # GTSAM: rotation first, error on the right
        precision = rotation @ np.linalg.inv(covariance) @ rotation.T
        if i > j:
            precision, rotation = rotation.T @ precision @ rotation, rotation.T
        np.testing.assert_allclose(problem.rotations[row], rotation, atol=1e-12)
        np.testing.assert_allclose(problem.precisions[row], precision, rtol=1e-6, atol=1e-9)


def test_gtsam_reads_the_same_headings(tmp_path: Path) -> None:
    import gtsam

    lines = [f"VERTEX_SE2 {k} 0 0 0" for k in range(5)]
    lines += [f"EDGE_SE2 {i} {j} 1 0 {0.3 * i - 0.7 * j} 1 0 0 1 0 {1 + i}" for i, j in PAIRS]
    path = written(tmp_path, *lines)
    problem = read_graph(path).problem
    factors, _ = gtsam.readG2o(str(path), False)
    for row in range(problem.m):
        factor = factors.at(row)
        heading = factor.measured().theta() * (1 if factor.keys()[0] < factor.keys()[1] else -1)
        np.testing.assert_allclose(problem.rotations[row], so3.exp(np.array([0, 0, heading])), atol=1e-12)
        assert problem.precisions is not None
        assert problem.precisions[row, 2, 2] == pytest.approx(factor.noiseModel().covariance()[2, 2] ** -1)


def test_information_that_is_no_matrix_is_not_used_and_noted(tmp_path: Path) -> None:
    good = np.diag([1.0, 1, 1, 2, 3, 4])
    for what in (np.nan, -1.0, 0.0):
        bad = good.copy()
        bad[3:, 3:] *= what
        graph = read_graph(written(tmp_path, edge(0, 1, upper(good)), edge(1, 2, upper(bad))))
        assert graph.problem.precisions is None
        assert len(graph.notes) == 1
        assert graph.notes[0].startswith("the information of 1 of 2 edges is no symmetric positive matrix")
    bad = good.copy()
    bad[:3, :3] = np.nan  # of the position, which is not needed
    graph = read_graph(written(tmp_path, edge(0, 1, upper(bad)), edge(1, 2, upper(4 * good))))
    assert graph.problem.precisions is not None
    np.testing.assert_allclose(np.linalg.eigvalsh(graph.problem.precisions[0]), [2, 3, 4], rtol=1e-12)


def test_information_that_is_the_same_everywhere_says_nothing(tmp_path: Path) -> None:
    graph = read_graph(written(tmp_path, *(edge(i, j, upper(7 * np.eye(6))) for i, j in PAIRS)))
    assert graph.problem.carries == frozenset()
    assert graph.notes == ()


def test_what_is_known_of_a_rotation_alone() -> None:
    full = random_information(np.random.default_rng(6))[None]
    np.testing.assert_allclose(marginal(full, slice(3, 6))[0], np.linalg.inv(np.linalg.inv(full[0])[3:, 3:]), rtol=1e-9)
    assert (marginal(np.diag([0.0, 0, 0, 1, 2, 3])[None], slice(3, 6)) == np.diag([1.0, 2, 3])).all()


# --- written -----------------------------------------------------------------------------------------


def vertices(path: Path, tag: str) -> dict[int, list[float]]:
    lines = path.read_text(encoding="utf-8").splitlines()
    words = [line.partition("#")[0].split() for line in lines if line.startswith(tag)]
    return {int(w[1]): list(map(float, w[2:])) for w in words}


def test_vertices_are_replaced_and_the_first_keeps_its_own(tmp_path: Path) -> None:
    start = so3.random(np.random.default_rng(1), 5)
    lines = [f"VERTEX_SE3:QUAT {k} {k} 2 3 {quaternion(start[k])}  # {k}" for k in range(5)]
    path = written(tmp_path, "# mine", *lines, "FIX 0", *(edge(i, j) for i, j in PAIRS))
    graph = read_graph(path)
    rotations = np.swapaxes(POSES, 1, 2) @ so3.random(np.random.default_rng(2), 1)
    rotations[3] = np.nan
    rotations_writer(tmp_path / "out.g2o", graph)(graph.cameras, rotations, {})
    out = vertices(tmp_path / "out.g2o", "VERTEX")
    found = {k: so3.from_quaternion(np.array([v[6], *v[3:6]])) for k, v in out.items()}
    assert [v[:3] for v in out.values()] == [[k, 2, 3] for k in range(5)]
    np.testing.assert_allclose(found[0], start[0], atol=1e-12)
    np.testing.assert_allclose(found[3], start[3], atol=1e-12)
    for i, j in [(0, 1), (1, 2), (0, 4)]:
        np.testing.assert_allclose(found[i].T @ found[j], POSES[i].T @ POSES[j], atol=1e-12)
    rest = [line for line in path.read_text().splitlines() if "VERTEX" not in line]
    assert [line for line in (tmp_path / "out.g2o").read_text().splitlines() if "VERTEX" not in line] == rest


def test_headings_and_angles_are_written_as_they_are_read(tmp_path: Path) -> None:
    lines = [f"VERTEX_SE2 {k} 0 0 {0.1 if k == 0 else 0}" for k in range(5)]
    lines += [f"EDGE_SE2 {i} {j} 1 0 {x}" for (i, j), x in zip(PAIRS, 2 * np.arange(7) - 6, strict=True)]
    graph = read_graph(written(tmp_path, *lines))
    turned = so3.exp(-HEADINGS[:, None] * np.array([0, 0, 1.0])) @ so3.random(np.random.default_rng(2), 1)
    rotations_writer(tmp_path / "out.g2o", graph)(graph.cameras, turned, {})
    found = np.array([v[2] for v in vertices(tmp_path / "out.g2o", "VERTEX").values()])
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * (HEADINGS - HEADINGS[0] + 0.1)), atol=1e-12)
    toro = read_graph(written(tmp_path, "EDGE3 0 1 0 0 0 0.1 0.2 0.3", "EDGE3 0 2 0 0 0 0.4 1.5707963267948966 0"))
    rotations = np.stack([np.eye(3), *np.swapaxes(toro.problem.rotations, 1, 2)])
    rotations_writer(tmp_path / "out.graph", toro)(toro.cameras, rotations, {})
    angles = np.array([v[3:] for v in vertices(tmp_path / "out.graph", "VERTEX3").values()])
    np.testing.assert_allclose(so3.from_euler(angles), np.swapaxes(rotations, 1, 2), atol=1e-12)
