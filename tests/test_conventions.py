"""The convention doctor: every mistake is told by its name and numbers, and data that are right are left in peace."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from graphs import grid_edges, random_edges, simulated

from bench.core import so3
from bench.core.problem import Floats, Problem
from bench.scoring.conventions import diagnose
from bench.scoring.conventions.closure import closing, loops_of
from bench.scoring.conventions.readings import turns
from bench.scoring.metrics.cycles import sample_cycles

OPENGL = np.diag([1.0, -1, -1])
BODY = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
SOME = "R_ij^T in place of R_ij on some edges"


def transposed(rotations: Floats) -> Floats:
    return np.swapaxes(rotations, -1, -2)


def rolled(rotations: Floats, by: int) -> Floats:
    """As a reader makes them that takes the scalar of a quaternion from the other end."""
    return so3.from_quaternion(np.roll(so3.to_quaternion(rotations), by, axis=-1))


def shifted(truth: Floats, by: int) -> Floats:
    out = np.roll(truth, by, axis=0)
    out[0 if by > 0 else -1] = np.nan
    return out


def as_text(truth: Floats) -> Floats:
    return truth[sorted(range(len(truth)), key=str)]


OF_TRUTH: dict[str, Callable[[Floats], Floats]] = {
    "R_i^T in place of R_i": transposed,
    "diag(1, -1, -1) R_i in place of R_i": lambda truth: OPENGL @ truth,
    "diag(-1, -1, 1) R_i in place of R_i": lambda truth: np.diag([-1.0, -1, 1]) @ truth,
    "(y, z, x) of R_i in place of R_i": lambda truth: np.roll(truth, 1, axis=1),
    "(-y, -z, x) of R_i in place of R_i": lambda truth: BODY.T @ truth,
    "(z, -x, -y) of R_i in place of R_i": lambda truth: BODY @ truth,
    "R_i^T in place of R_i, then diag(1, -1, -1) R_i in place of R_i": lambda truth: transposed(OPENGL @ truth),
    "quaternions of R_i with the scalar last": lambda truth: rolled(truth, -1),
    "quaternions of R_i with the scalar first": lambda truth: rolled(truth, 1),
    "quaternions of R_i^T with the scalar first": lambda truth: transposed(rolled(transposed(truth), 1)),
    "the truth of camera k + 1 for camera k": lambda truth: shifted(truth, 1),
    "the truth of camera k - 1 for camera k": lambda truth: shifted(truth, -1),
    "the truth in reverse order": lambda truth: truth[::-1],
    "the truth in another order": as_text,
}
OF_MEASUREMENTS: dict[str, Callable[[Floats], Floats]] = {
    "R_ij^T in place of R_ij": transposed,
    "quaternions of R_ij with the scalar last": lambda rotations: rolled(rotations, -1),
    "quaternions of R_ij with the scalar first": lambda rotations: rolled(rotations, 1),
}


@pytest.fixture(scope="module")
def scene() -> tuple[Problem, Floats]:
    return simulated(random_edges(30, 0.4), noise_deg=1, outliers=0.3)


@pytest.mark.parametrize("name", OF_TRUTH)
def test_a_truth_that_is_meant_otherwise(scene: tuple[Problem, Floats], name: str) -> None:
    problem, truth = scene
    found = diagnose(problem, OF_TRUTH[name](truth))
    assert found is not None
    assert name in (found.best, *found.alternatives)
    assert len(found.alternatives) <= (
        "quaternions" in name
    )  # of R_i with one end first are those of R_i^T with the other
    assert found.as_given_deg > 60
    assert found.best_deg < 3
    assert found.share_as_given < 0.15 < 0.6 < found.share
    assert found.best in found.sentence


@pytest.mark.parametrize("with_truth", [True, False])
@pytest.mark.parametrize("name", OF_MEASUREMENTS)
def test_measurements_that_are_meant_otherwise(scene: tuple[Problem, Floats], name: str, with_truth: bool) -> None:
    problem, truth = scene
    problem = replace(problem, rotations=OF_MEASUREMENTS[name](problem.rotations))
    found = diagnose(problem, truth if with_truth else None)
    assert found is not None
    assert found.best == name
    assert 2 * found.share_as_given < found.share
    if not with_truth:
        closed = sample_cycles(replace(problem, rotations=transposed(problem.rotations))).residuals
        shown = float(np.mean(closed <= found.tolerance_deg))
        assert name != "R_ij^T in place of R_ij" or found.share == pytest.approx(shown, abs=0.05)


def test_both_at_once(scene: tuple[Problem, Floats]) -> None:
    problem, truth = scene
    found = diagnose(replace(problem, rotations=transposed(problem.rotations)), OPENGL @ truth)
    assert found is not None
    assert found.best == "diag(1, -1, -1) R_i in place of R_i, then R_ij^T in place of R_ij"


def test_edges_of_both_directions() -> None:
    problem, truth = simulated(random_edges(30, 0.4), noise_deg=0.5)
    some = np.random.default_rng(0).random(problem.m) < 0.3
    mixed = replace(problem, rotations=np.where(some[:, None, None], transposed(problem.rotations), problem.rotations))
    for given in (truth, None):
        found = diagnose(mixed, given)
        assert found is not None
        assert found.best == SOME
        assert found.best_deg < 1.5 < 20 < found.as_given_deg + 20 * (given is not None)
        share = re.search(r"(\d+) % of the edges", found.sentence)
        assert share is not None
        assert float(share[1]) == pytest.approx(100 * some.mean(), abs=2)
    found = diagnose(mixed, OPENGL @ truth)
    assert found is not None
    assert found.best == f"diag(1, -1, -1) R_i in place of R_i, then {SOME}"


def test_a_fixed_turn_by_any_angle(scene: tuple[Problem, Floats]) -> None:
    problem, truth = scene
    found = diagnose(problem, so3.exp(np.radians([0, 0, 40.0])) @ truth)
    assert found is not None
    words = found.best.replace("(", " ").replace(")", " ").replace(",", " ").split()
    assert float(words[words.index("by") + 1]) == pytest.approx(40, abs=1)
    axis = np.array(words[words.index("about") + 1 :][:3], dtype=float)
    np.testing.assert_allclose(axis, [0, 0, -1], atol=0.03)
    assert found.best_deg < 3


def test_ids_of_the_file_tell_a_shift_where_rows_do_not() -> None:
    """Every other image is in the graph: the truth of k + 1 is that of an image outside."""
    rng = np.random.default_rng(1)
    table = so3.random(rng, 60)
    ids = np.sort(rng.choice(59, 20, replace=False))
    problem, _ = simulated(random_edges(20, 0.5))
    i, j = problem.edges.T
    problem = replace(problem, rotations=table[ids[i]] @ transposed(table[ids[j]]))
    wrong = np.roll(table, 1, axis=0)
    found = diagnose(problem, wrong[ids], ids=ids, table=wrong)
    assert found is not None
    assert found.best == "the truth of camera k + 1 for camera k"
    assert found.best_deg < 1e-6


def test_the_sentence_of_a_scene_in_other_axes() -> None:
    problem, truth = simulated(random_edges(8, 1.0))
    found = diagnose(problem, OPENGL @ truth)
    assert found is not None
    start = "the measurements agree with each other (triangles close to 0.00 degrees) and contradict the truth (median "
    assert found.sentence == (
        f"{start}{found.as_given_deg:.1f} degrees); with diag(1, -1, -1) R_i in place of R_i the truth fits to 0.00 "
        "degrees: it seems that the truth is in the axes of OpenGL and Bundler and the measurements in those of OpenCV "
        "and COLMAP, or the other way round"
    )
    assert (found.loops_deg, found.share, found.share_as_given) == (pytest.approx(0, abs=1e-6), 1, 0)


def test_what_fits_as_well_is_named() -> None:
    """About one axis, a turn, its inverse and that seen in other axes are the same."""
    angles = np.random.default_rng(0).uniform(-3, 3, 20)
    truth = so3.exp(angles[:, None] * [0, 0, 1])
    edges = random_edges(20, 0.5)
    problem = Problem(20, edges, truth[edges[:, 0]] @ transposed(truth[edges[:, 1]]))
    found = diagnose(problem, transposed(truth))
    assert found is not None
    named = {found.best, *found.alternatives}
    assert {"R_i^T in place of R_i", "R_ij^T in place of R_ij", "diag(1, -1, -1) R_i in place of R_i"} <= named


def test_a_truth_of_other_cameras_contradicts(scene: tuple[Problem, Floats]) -> None:
    problem, truth = scene
    found = diagnose(problem, truth[np.random.default_rng(3).permutation(30)])
    assert found is not None
    assert found.best == ""
    assert "none of the known mistakes explains it" in found.sentence
    assert found.as_given_deg > 90


@pytest.mark.parametrize("outliers", [0, 0.3, 0.6])
@pytest.mark.parametrize("noise_deg", [0, 1, 10])
def test_what_is_right_is_left_in_peace(noise_deg: float, outliers: float) -> None:
    tree = np.array([[k // 2, k + 1] for k in range(14)])
    ring = np.array([[k, k + 1] for k in range(9)] + [[0, 9]])
    for edges in (random_edges(40, 0.2), grid_edges(4, 5), tree, ring, random_edges(3, 1.0)):
        problem, truth = simulated(edges, noise_deg, outliers)
        assert diagnose(problem, truth) is None
        assert diagnose(problem) is None


@pytest.mark.parametrize("spread", [[0, 0, 0], [0, 0, 2.0], [0.02, 0.02, 0.02], [0.1, 2.0, 0.1]])
def test_where_conventions_look_alike_nothing_is_said(spread: list[float]) -> None:
    rng = np.random.default_rng(0)
    truth = so3.exp(rng.standard_normal((30, 3)) * spread)
    edges = random_edges(30, 0.3)
    noise = so3.exp(np.radians(3) * rng.standard_normal((len(edges), 3)))
    problem = Problem(30, edges, truth[edges[:, 0]] @ transposed(truth[edges[:, 1]]) @ noise)
    assert diagnose(problem, truth) is None
    assert diagnose(problem) is None
    if max(spread) < 0.1:
        assert diagnose(problem, transposed(truth)) is None


def test_no_truth_at_all_and_one_edge() -> None:
    problem, truth = simulated(np.array([[0, 1]]))
    assert diagnose(problem, truth) is None
    assert diagnose(problem, np.full_like(truth, np.nan)) is None
    assert closing(problem) is None


def test_the_turns_are_a_group_and_each_has_a_name() -> None:
    found = turns()
    matrices = np.array([turn.matrix for turn in found])
    assert len(np.unique(matrices.reshape(24, 9), axis=0)) == 24
    np.testing.assert_allclose(np.linalg.det(matrices), 1)
    assert not found[0].changes
    assert len({turn.changes[0].name for turn in found[1:]}) == 23


def test_loops_are_walked_and_longer_ones_taken_where_there_is_no_triangle() -> None:
    for edges in (random_edges(12, 0.4), grid_edges(4, 4)):
        problem, _ = simulated(edges)
        found = closing(problem)
        assert found is not None
        assert found.kind == ("triangles" if len(edges) > 24 else "loops")
        assert len(found.given) >= 5
        assert found.given.max() < 1e-5
    twice, _ = simulated(np.repeat(random_edges(12, 0.4), 2, axis=0))
    assert sample_cycles(twice).residuals.max() < 1e-5
    assert loops_of(twice).edges.max() < twice.m
