"""Folded scenes: what the dataset promises, and that folds are found where they are and nowhere else."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import load, part_of, the_source

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Floats
from bench.datasets.folded import Folded
from bench.methods.l1_irls import L1IRLS
from bench.methods.spectral import Spectral
from bench.scoring.metrics.folds import SMALLEST, Fold, border, find_folds, shared_folds

A_QUARTER = Folded(outliers=0.0)  # every outlier is an edge across, which tells who is in the part
TURN = so3.exp(np.radians(25) * np.array([0.6, 0, 0.8]))


# --- the dataset -------------------------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(
    n=st.integers(4, 40),
    share=st.floats(0, 1),
    agreeing=st.floats(0, 1),
    outliers=st.floats(0, 1),
    seed=st.integers(0, 1000),
)
def test_folded_scenes_are_what_was_asked_for(
    n: int, share: float, agreeing: float, outliers: float, seed: int
) -> None:
    folded = Folded(n, share, agreeing=agreeing, across=0.5, missing=0.1, outliers=outliers, noise_deg=0.0)
    instance = load(folded, seed=seed)
    assert instance.problem.n == n
    assert not instance.problem.components.any()
    assert instance.truth is not None
    assert instance.outliers is not None
    residuals = np.degrees(instance.problem.residuals(instance.truth))
    assert residuals[~instance.outliers].max(initial=0) < 1e-10
    assert instance.outliers.sum() >= round(outliers * instance.problem.m)


def test_the_edges_across_are_wrong_all_in_the_same_way() -> None:
    instance = load(Folded(n=60, agreeing=1.0, outliers=0.0, noise_deg=0.0))
    truth, problem, wrong = instance.truth, instance.problem, instance.outliers
    assert truth is not None
    assert wrong is not None
    np.testing.assert_allclose(np.degrees(problem.residuals(truth)[wrong]), 25, atol=1e-10)
    # all edges across, and no other, are wrong: without them the graph has two pieces, of 15 and 45 cameras
    pieces = dataclasses.replace(problem, edges=problem.edges[~wrong], rotations=problem.rotations[~wrong]).components
    assert sorted(np.bincount(pieces)) == [15, 45]
    i, j = problem.edges[wrong].T
    of_world = np.swapaxes(truth[i], 1, 2) @ problem.rotations[wrong] @ truth[j]  # F, or its inverse
    of_world = np.where((pieces[i] == 1)[:, None, None], of_world, np.swapaxes(of_world, 1, 2))
    assert np.degrees(so3.angle_between(of_world, of_world[0])).max() < 1e-10


def test_the_seed_and_the_parameters_decide() -> None:
    one, same, other = (load(Folded(n=40), seed=seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one.problem.rotations, same.problem.rotations)
    assert one.revision == same.revision != other.revision
    changes: list[dict[str, float]] = [{}, {"n": 50}, {"share": 0.1}, {"angle_deg": 90.0}, {"agreeing": 1.0}]
    changes += [{"across": 0.1}, {"missing": 0.5}, {"noise_deg": 2.0}, {"outliers": 0.4}]
    sources = [the_source(Folded(**change)) for change in changes]  # type: ignore[arg-type]
    assert sources[0].name == "n200-share0.25-angle25.0-outliers0.1"
    assert len({s.name for s in sources}) == len({s.revision for s in sources}) == len(changes)
    assert sources[0].seeded


def test_parts_that_are_never_joined_are_refused() -> None:
    with pytest.raises(InputError, match="choose a smaller missing, or a larger across or n"):
        load(Folded(n=10, across=0.0))


# --- folds of an estimate ----------------------------------------------------------------------------


def estimated(seed: int, n: int, noise_deg: float, freedom: float = np.inf, lost: float = 0.0) -> tuple[Floats, Floats]:
    """Truth, and an estimate with errors of Student's distribution, in a gauge of its own; some cameras are lost."""
    rng = np.random.default_rng([seed, n])
    truth = so3.random(rng, n)
    errors = np.radians(noise_deg) * rng.standard_normal((n, 3))
    if np.isfinite(freedom):
        errors /= np.sqrt(rng.chisquare(freedom, (n, 1)) / freedom)
    estimate = truth @ so3.exp(errors)
    gone = rng.random(n) < lost
    estimate[gone] = so3.random(rng, int(gone.sum()))
    return truth, estimate @ so3.random(rng, 1)[0]


def folded(estimate: Floats, truth: Floats, cameras: Floats, turn: Floats = TURN) -> Floats:
    """The estimate with some of its cameras turned in the world of the truth."""
    gauge = so3.geodesic_median(np.swapaxes(truth, 1, 2) @ estimate)
    out = estimate.copy()
    out[cameras] = estimate[cameras] @ gauge.T @ turn @ gauge
    return out


@pytest.mark.parametrize("noise_deg", [0.3, 1.5, 3])
@pytest.mark.parametrize("n", [60, 400])
def test_a_fold_is_found_with_its_cameras_and_its_angle(n: int, noise_deg: float) -> None:
    truth, estimate = estimated(0, n, noise_deg)
    cameras = np.sort(np.random.default_rng(1).permutation(n)[: n // 4])
    (fold,) = find_folds(folded(estimate, truth, cameras), truth)
    assert len(np.intersect1d(fold.cameras, cameras)) >= 0.95 * max(len(cameras), len(fold.cameras))
    assert fold.angle_deg == pytest.approx(25, abs=2)
    assert np.degrees(np.arccos(fold.axis @ [0.6, 0, 0.8])) < 6
    assert fold.share == pytest.approx(0.25, abs=0.02)
    assert fold.spread_deg == pytest.approx(1.54 * noise_deg, rel=0.35)
    assert fold.main_spread_deg == pytest.approx(1.54 * noise_deg, rel=0.35)


def test_a_fold_may_be_far_less_precise_than_the_rest() -> None:
    rng = np.random.default_rng(0)
    truth, estimate = estimated(0, 300, 0.5)
    estimate[:60] = estimate[:60] @ so3.exp(np.radians(3.0) * rng.standard_normal((60, 3)))
    (fold,) = find_folds(folded(estimate, truth, np.arange(60)), truth)
    np.testing.assert_array_equal(fold.cameras, np.arange(60))
    assert fold.spread_deg > 4 * fold.main_spread_deg


def test_two_folds_are_told_apart_and_unsolved_cameras_are_left_out() -> None:
    truth, estimate = estimated(0, 300, 1.0)
    estimate = folded(estimate, truth, np.arange(100, 150))
    estimate = folded(estimate, truth, np.arange(20), so3.exp(np.array([0, 1.0, 0])))
    estimate[140:145] = np.nan
    truth[145:150] = np.nan
    one, other = find_folds(estimate, truth)
    np.testing.assert_array_equal(one.cameras, np.arange(100, 140))
    np.testing.assert_array_equal(other.cameras, np.arange(20))
    assert (one.angle_deg, other.angle_deg) == pytest.approx((25, np.degrees(1)), abs=1)


def test_a_fold_does_not_depend_on_the_gauge() -> None:
    truth, estimate = estimated(0, 100, 1.0)
    estimate = folded(estimate, truth, np.arange(30))
    (one,), (other,) = (find_folds(estimate @ q, truth) for q in so3.random(np.random.default_rng(0), 2))
    np.testing.assert_array_equal(one.cameras, other.cameras)
    assert np.degrees(so3.angle_between(one.rotation, other.rotation)) < 1e-6


@pytest.mark.parametrize("noise_deg", [0.3, 2, 8])
@pytest.mark.parametrize("freedom", [np.inf, 2, 1])
@pytest.mark.parametrize("lost", [0, 0.3])
def test_ordinary_and_heavy_tailed_errors_raise_no_alarm(noise_deg: float, freedom: float, lost: float) -> None:
    for seed in range(6):
        for n in (40, 250):
            truth, estimate = estimated(seed, n, noise_deg, freedom, lost)
            assert find_folds(estimate, truth) == ()


def test_estimates_at_random_and_tiny_ones_raise_no_alarm() -> None:
    for seed in range(5):
        truth, estimate = estimated(seed, 200, 1.0, lost=1.0)
        assert find_folds(estimate, truth) == ()
    truth, estimate = estimated(0, SMALLEST - 1, 0.1)
    assert find_folds(folded(estimate, truth, np.arange(6)), truth) == ()
    assert find_folds(np.full_like(truth, np.nan), truth) == ()


@pytest.mark.parametrize(("n", "size"), [(30, 10), (30, 6), (20, 7), (16, 6)])
@pytest.mark.parametrize("angle_deg", [25, 180])
def test_a_fold_of_a_small_scene_is_found(n: int, size: int, angle_deg: float) -> None:
    turn = so3.exp(np.radians(angle_deg) * np.array([0.6, 0, 0.8]))
    for seed in range(5):
        truth, estimate = estimated(seed, n, 0.5)
        (fold,) = find_folds(folded(estimate, truth, np.arange(n - size, n), turn), truth)
        np.testing.assert_array_equal(fold.cameras, np.arange(n - size, n))
        assert fold.angle_deg == pytest.approx(angle_deg, abs=2)


@pytest.mark.parametrize("freedom", [np.inf, 2, 1])
@pytest.mark.parametrize("lost", [0, 0.3, 0.6])
def test_small_scenes_raise_no_alarm(freedom: float, lost: float) -> None:
    for seed in range(5):
        for n in (SMALLEST, 20, 31):
            for noise_deg in (0.3, 8):
                truth, estimate = estimated(seed, n, noise_deg, freedom, lost)
                assert find_folds(estimate, truth) == ()


def test_folds_of_several_methods_are_put_together() -> None:
    def fold(cameras: range, angle: float) -> Fold:
        return Fold(np.array(cameras), so3.exp(np.array([0, 0, angle])), 0.1, 1.0, 1.0)

    found = {"a": [fold(range(30), 0.4), fold(range(50, 60), 0.2)], "b": [fold(range(25), 0.1)], "c": []}
    both, alone = shared_folds(found)
    assert (list(both.folds), list(alone.folds)) == (["a", "b"], ["a"])
    np.testing.assert_array_equal(both.cameras, np.arange(30))
    np.testing.assert_array_equal(alone.cameras, np.arange(50, 60))
    assert shared_folds({"a": []}) == []
    one, other = shared_folds({"a": [fold(range(10), 0.2)], "b": [fold(range(5, 20), 0.2)]})
    assert (list(one.folds), list(other.folds)) == (["b"], ["a"])
    (three,) = shared_folds({"a": [fold(range(10), 0.2)], "b": [fold(range(9), 0.2)], "c": [fold(range(12), 0.2)]})
    np.testing.assert_array_equal(three.cameras, np.arange(10))


# --- both together -----------------------------------------------------------------------------------


def test_wrong_measurements_that_agree_fold_a_robust_estimate() -> None:
    """A quarter of the cameras by 25 degrees: the right cameras to 95 %, the angle to 2 degrees."""
    for seed in range(3):
        instance = load(A_QUARTER, seed=seed)
        problem, truth, part = instance.problem, instance.truth, part_of(instance)
        assert truth is not None
        assert len(part) == 50
        rotations = L1IRLS().solve(problem, np.random.default_rng(0)).rotations
        (fold,) = find_folds(rotations, truth)
        assert len(np.intersect1d(fold.cameras, part)) >= 0.95 * max(len(part), len(fold.cameras))
        assert fold.angle_deg == pytest.approx(25, abs=2)
        agree, across = border(problem, problem.residuals(rotations), problem.residuals(truth), fold.cameras)
        assert 0.6 < agree / across < 0.8


def test_least_squares_settle_between() -> None:
    instance = load(A_QUARTER)
    assert instance.truth is not None
    estimate = Spectral().solve(instance.problem, np.random.default_rng(0))
    (fold,) = find_folds(np.asarray(getattr(estimate, "rotations", estimate)), instance.truth)
    assert 15 < fold.angle_deg < 20
