"""Lie-algebraic averaging and robust Levenberg-Marquardt: agreement with peers, descent, recovery."""

from pathlib import Path

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated
from scenes import load
from scipy import integrate, stats

from bench.core import so3
from bench.core.problem import Floats, Problem
from bench.datasets.one_dsfm import OneDSfM
from bench.methods._lib.descent.iterate import Iterate, floored
from bench.methods._lib.descent.losses import LOSSES, MAGSAC_CUT, LossName
from bench.methods._lib.graph.trees import tree_rotations
from bench.methods._lib.gtsam_values import rotations_of, values_of
from bench.methods._lib.starts import Start, start_rotations
from bench.methods.l1_irls import L1IRLS
from bench.methods.lie_averaging import LieAveraging
from bench.methods.robust_lm import RobustLM
from bench.methods.spectral import Spectral

RNG = np.random.default_rng(0)
DENSE = random_edges(60, 0.4)
EVERY_START = pytest.mark.parametrize("init", ["spectral", "spanning-tree"])


def test_turned_cameras_are_products_of_matrices() -> None:
    problem, truth = simulated(DENSE, outliers=1.0)
    steps = np.random.default_rng(1).standard_normal((problem.n, 3))
    moved = Iterate.at(problem, truth).turned(steps)
    np.testing.assert_allclose(moved.rotations, truth @ so3.exp(steps), atol=1e-12)
    np.testing.assert_allclose(moved.angles, problem.residuals(truth @ so3.exp(steps)), atol=1e-12)


def test_weights_keep_a_floor() -> None:
    np.testing.assert_array_equal(floored(np.array([0.0, 2.0])), [2e-10, 2.0])
    assert floored(np.zeros(2)).min() > 0


def test_the_magsac_weight_is_a_likelihood_averaged_over_noise_levels() -> None:
    """Numerically: chi density with three degrees of freedom, cut at its 99 % quantile, sigma uniform on [0, 1]."""
    assert pytest.approx(stats.chi(3).ppf(0.99), abs=1e-4) == MAGSAC_CUT

    def average(residual: float) -> float:
        def density(sigma: float) -> float:
            return float(stats.chi(3).pdf(residual / sigma)) / sigma

        return float(integrate.quad(density, residual / MAGSAC_CUT, 1.0)[0])

    residuals = np.array([0.05, 0.5, 1.0, 2.0, 3.0])
    weights = LOSSES["magsac"].weight(residuals / LOSSES["magsac"].scale(1.0))
    averaged = np.array([average(r) for r in residuals])
    np.testing.assert_allclose(weights / weights[0], averaged / averaged[0], rtol=1e-6)
    assert LOSSES["magsac"].weight(np.array([0.0, MAGSAC_CUT / np.sqrt(2)])).tolist() == pytest.approx([1, 0])


def gtsam_least_squares(problem: Problem, start: Floats) -> Floats:
    import gtsam

    graph = gtsam.NonlinearFactorGraph()
    noise = gtsam.noiseModel.Isotropic.Sigma(3, 1.0)
    for (i, j), rotation in zip(problem.edges.tolist(), problem.rotations, strict=True):
        graph.add(gtsam.BetweenFactorRot3(i, j, gtsam.Rot3(rotation), noise))
    graph.add(gtsam.PriorFactorRot3(0, gtsam.Rot3(start[0].T), noise))
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-12)
    return rotations_of(gtsam.LevenbergMarquardtOptimizer(graph, values_of(start), parameters).optimize(), problem.n)


@EVERY_START
def test_lie_averaging_agrees_with_gtsam(init: Start) -> None:
    problem, _ = simulated(random_edges(25, 0.5), noise_deg=8, outliers=0.1)
    estimate = LieAveraging(init=init, tolerance_deg=1e-6).solve(problem, RNG)
    theirs = gtsam_least_squares(problem, start_rotations(init, problem, RNG))
    assert estimate.cost == pytest.approx((problem.residuals(theirs) ** 2).sum(), rel=1e-6)
    assert errors_deg(estimate.rotations, theirs).max() < 0.05


def test_the_error_of_a_loop_is_shared() -> None:
    turns = so3.exp(np.radians([[0, 0, 10], [0, 0, 10], [0, 0, 26]]))
    problem = Problem(3, np.array([[0, 1], [1, 2], [0, 2]]), turns)
    estimate = LieAveraging().solve(problem, RNG)
    np.testing.assert_allclose(np.degrees(problem.residuals(estimate.rotations)), 2, atol=1e-6)


@EVERY_START
@pytest.mark.parametrize("loss", ["cauchy", "huber"])
def test_levenberg_marquardt_ends_where_reweighting_does(init: Start, loss: LossName) -> None:
    problem, _ = simulated(DENSE, noise_deg=3, outliers=0.2)
    estimate = RobustLM(loss=loss, init=init, tolerance_deg=1e-6).solve(problem, RNG)
    reweighted = L1IRLS(loss=loss, tolerance_deg=1e-6, irls_iterations=500).solve(problem, RNG)
    assert estimate.cost == pytest.approx(reweighted.cost, rel=1e-8)
    assert errors_deg(estimate.rotations, reweighted.rotations).max() < 1e-3


@pytest.mark.parametrize("loss", ["geman-mcclure", "cauchy", "magsac", "talwar"])
def test_the_cost_never_rises(loss: LossName) -> None:
    problem, _ = simulated(grid_edges(6, 10), noise_deg=5, outliers=0.1)
    costs = [RobustLM(loss=loss, iterations=k).solve(problem, RNG).cost for k in range(15)]
    assert None not in costs
    assert np.all(np.diff(np.array(costs)) <= 0)


@pytest.mark.parametrize("loss", ["geman-mcclure", "cauchy"])
def test_outliers_are_rejected(loss: LossName) -> None:
    problem, truth = simulated(DENSE, noise_deg=1, outliers=0.3)
    estimate = RobustLM(loss=loss).solve(problem, RNG)
    assert np.median(errors_deg(Spectral().solve(problem, RNG).rotations, truth)) > 1
    assert errors_deg(estimate.rotations, truth).max() < 3
    assert np.median(errors_deg(estimate.rotations, truth)) < 0.5
    assert estimate.edge_weights is not None
    outlying = np.degrees(problem.residuals(truth)) > 40
    assert estimate.edge_weights[outlying].max() < estimate.edge_weights[~outlying].min()


def test_levenberg_marquardt_says_why_it_ended() -> None:
    problem, _ = simulated(DENSE, noise_deg=3, outliers=0.3)
    assert RobustLM(iterations=2).solve(problem, RNG).stop_reason == "iteration limit"
    assert LieAveraging(iterations=1).solve(problem, RNG).stop_reason == "iteration limit"
    assert RobustLM().solve(problem, RNG).stop_reason == "mean step below 0.001 degrees"


def test_nothing_moves_where_every_edge_is_rejected() -> None:
    ring, _ = simulated(np.array([[0, 1], [1, 2], [0, 2]], dtype=np.int32), outliers=1.0)
    estimate = RobustLM(loss="talwar", sigma_deg=1e-3, init="spectral").solve(ring, RNG)
    assert np.isfinite(estimate.rotations).all()
    assert estimate.cost == pytest.approx(1.5)


@pytest.mark.real_data
def test_ellis_island(real_data: Path) -> None:
    instance = load(OneDSfM(scene="Ellis_Island"), real_data / "1dsfm")
    assert instance.truth is not None
    robust = errors_deg(RobustLM().solve(instance.problem, RNG).rotations, instance.truth)
    assert robust.mean() < 3.3
    assert np.median(robust) < 0.62
    squares = LieAveraging().solve(instance.problem, RNG)
    theirs = gtsam_least_squares(instance.problem, tree_rotations(instance.problem))
    assert squares.cost == pytest.approx((instance.problem.residuals(theirs) ** 2).sum(), rel=1e-3)
