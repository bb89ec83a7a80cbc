"""Theia's rotation averaging: its convention, that it agrees with ours, and what it does not tell."""

from pathlib import Path

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated

from bench import Floats, Problem, so3
from bench.datasets.one_dsfm import OneDSfM
from bench.methods.l1_irls import L1IRLS
from bench.methods.theia import Theia
from bench.plugins.declare import Source

pytheia = pytest.importorskip("pytheia", reason="pytheia is not installed; it has wheels for Linux on x86-64")

RNG = np.random.default_rng(0)
GRAPH = random_edges(30, 0.4)


def about_z(degrees: float) -> Floats:
    return so3.exp(np.array([0, 0, np.radians(degrees)]))


def test_two_cameras_have_their_measured_relative_rotation() -> None:
    measured = so3.random(np.random.default_rng(1), 1)
    first, second = Theia().solve(Problem(2, np.array([[0, 1]]), measured), RNG).rotations
    np.testing.assert_allclose(first @ second.T, measured[0], atol=1e-12)


def test_a_loop_error_is_shared_by_the_loop() -> None:
    """From a start that is no solution of any edge: by a transposed convention it would not be shared."""
    problem = Problem(3, np.array([[0, 1], [1, 2], [0, 2]]), np.array([about_z(1), about_z(1), about_z(2.6)]))
    rotations = Theia(init="spectral").solve(problem, RNG).rotations
    relative = rotations[[0, 1, 0]] @ np.swapaxes(rotations[[1, 2, 2]], -1, -2)
    expected = np.array([about_z(1.2), about_z(1.2), about_z(2.4)])
    assert np.degrees(so3.angle_between(relative, expected)).max() < 0.01


@pytest.mark.parametrize("init", ["spanning-tree", "spectral"])
def test_without_noise_it_is_exact_as_l1_irls_is(init: str) -> None:
    problem, truth = simulated(GRAPH)
    found = Theia(init=init).solve(problem, RNG).rotations  # type: ignore[arg-type]
    assert errors_deg(found, truth).max() < 1e-6
    assert errors_deg(found, L1IRLS(init=init).solve(problem, RNG).rotations).max() < 1e-6  # type: ignore[arg-type]


def test_with_noise_and_outliers_it_ends_where_l1_irls_does() -> None:
    """Both stop at a mean step of a thousandth of a radian, so they agree to about that."""
    problem, truth = simulated(GRAPH, noise_deg=2, outliers=0.2)
    theirs, ours = Theia().solve(problem, RNG).rotations, L1IRLS().solve(problem, RNG).rotations
    assert errors_deg(theirs, ours).max() < 0.25
    assert np.median(errors_deg(theirs, truth)) < 1.5


def test_weights_choose_the_tree_that_it_starts_from(monkeypatch: pytest.MonkeyPatch) -> None:
    """Between the start and the answer, with no step allowed, there is nothing else."""
    clean, truth = simulated(GRAPH, noise_deg=0, outliers=0.3)
    weights = np.where(clean.residuals(truth) > 1e-6, 1.0, 100.0)
    options = pytheia.sfm.RobustRotationEstimatorOptions()
    options.max_num_l1_iterations = options.max_num_irls_iterations = 0
    monkeypatch.setattr("pytheia.sfm.RobustRotationEstimatorOptions", lambda: options)
    weighted = Problem(clean.n, clean.edges, clean.rotations, weights)
    assert errors_deg(Theia().solve(weighted, RNG).rotations, truth).max() < 1e-6
    assert errors_deg(Theia().solve(clean, RNG).rotations, truth).max() > 30


def test_parallel_edges_all_count() -> None:
    """Of three measurements of one edge, two agree."""
    edges = np.array([[0, 1], [0, 1], [0, 1]])
    problem = Problem(2, edges, np.array([about_z(90), about_z(10), about_z(10)]))
    first, second = Theia().solve(problem, RNG).rotations
    assert np.degrees(so3.angle_between(first @ second.T, about_z(10))) < 0.1


def test_an_answer_that_is_no_rotation_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    class Failing:
        def __init__(self, options: object) -> None:
            pass

        def AddRelativeRotationConstraint(self, pair: object, vector: object) -> None:  # noqa: N802
            pass

        def EstimateRotations(self, pairs: object, start: dict[int, Floats]) -> dict[int, Floats]:  # noqa: N802
            return {camera: np.full(3, np.nan) for camera in start}

    monkeypatch.setattr("pytheia.sfm.RobustRotationEstimator", Failing)
    with pytest.raises(RuntimeError, match="not finite"):
        Theia().solve(simulated(GRAPH)[0], RNG)


@pytest.mark.real_data
def test_ellis_island(real_data: Path) -> None:
    (source,) = OneDSfM(scene="Ellis_Island").sources(real_data / "1dsfm", 0)
    assert isinstance(source, Source)
    instance = source.load()
    assert instance.truth is not None
    estimate = Theia().solve(instance.problem, RNG)
    errors = errors_deg(estimate.rotations, instance.truth)
    assert 2.5 <= errors.mean() <= 3.2
    assert 0.5 <= np.median(errors) <= 0.6
    assert estimate.conversion_s
