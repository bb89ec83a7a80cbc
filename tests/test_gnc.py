"""Graduated non-convexity, ours and GTSAM's: weights, agreement, what they recover."""

from pathlib import Path

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated, transformed
from scenes import load

from bench.datasets.one_dsfm import OneDSfM
from bench.methods._lib.descent.surrogates import SURROGATES, GncLoss
from bench.methods._lib.starts import Start
from bench.methods.gnc import GNC
from bench.methods.gtsam_gnc import GtsamGNC
from bench.methods.l1_irls import L1IRLS
from bench.methods.spectral import Spectral

RNG = np.random.default_rng(0)
DENSE = random_edges(60, 0.4)
SMALL = random_edges(25, 0.5)
EVERY_LOSS = pytest.mark.parametrize("loss", ["tls", "geman-mcclure"])
EVERY_START = pytest.mark.parametrize("init", ["spectral", "spanning-tree"])
PENALTIES = {
    "tls": lambda w, mu: mu * (1 - w) / (mu + w),
    "geman-mcclure": lambda w, mu: mu * (np.sqrt(w) - 1) ** 2,
}


@EVERY_LOSS
@pytest.mark.parametrize("mu", [0.01, 1.0, 7.0])
def test_weights_minimise_the_squares_with_their_penalty(loss: GncLoss, mu: float) -> None:
    """The outlier process of Black and Rangarajan: the weight is the w that minimises w x + penalty(w)."""
    w = np.linspace(0, 1, 20001)
    x = np.concatenate([np.linspace(0, 3, 61), [150.0]])
    wanted = w[np.argmin(w * x[:, None] + PENALTIES[loss](w, mu), axis=1)]
    np.testing.assert_allclose(SURROGATES[loss].weight(x, mu), wanted, atol=1e-4)


@EVERY_LOSS
def test_the_last_weights_are_derivatives_of_the_cost(loss: GncLoss) -> None:
    surrogate, step = SURROGATES[loss], 1e-6
    x = np.linspace(0.053, 2.053, 41)
    derivative = (surrogate.cost(x + step) - surrogate.cost(x - step)) / (2 * step)
    np.testing.assert_allclose(surrogate.weight(x, 1e9 if loss == "tls" else 1.0), derivative, atol=1e-6)


@EVERY_LOSS
def test_the_first_surrogate_is_nearly_convex(loss: GncLoss) -> None:
    """No residual is rejected at first."""
    x = np.linspace(0, 100, 1001)
    assert SURROGATES[loss].weight(x, SURROGATES[loss].first(100.0)).min() > 1e-3


@pytest.mark.parametrize(("loss", "outliers"), [("tls", 0.2), ("tls", 0.5), ("geman-mcclure", 0.2)])
def test_agrees_with_gtsam(loss: GncLoss, outliers: float) -> None:
    problem, _ = simulated(SMALL, noise_deg=3, outliers=outliers)
    ours = GNC(loss=loss, threshold_deg=20, tolerance_deg=1e-4).solve(problem, RNG)
    theirs = GtsamGNC(loss=loss, threshold_deg=20, tolerance=1e-9).solve(problem, RNG)
    assert errors_deg(ours.rotations, theirs.rotations).max() < (0.01 if loss == "tls" else 0.2)
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-4)
    assert ours.edge_weights is not None
    assert theirs.edge_weights is not None
    np.testing.assert_allclose(ours.edge_weights, theirs.edge_weights, atol=1e-3 if loss == "tls" else 0.02)


@EVERY_LOSS
@EVERY_START
def test_outliers_are_rejected(loss: GncLoss, init: Start) -> None:
    problem, truth = simulated(DENSE, outliers=0.4)
    assert np.median(errors_deg(Spectral().solve(problem, RNG).rotations, truth)) > 1
    assert errors_deg(GNC(loss=loss, init=init).solve(problem, RNG).rotations, truth).max() < 0.2


def test_rejected_edges_are_those_above_the_threshold() -> None:
    problem, truth = simulated(DENSE, noise_deg=1, outliers=0.4)
    estimate = GNC(threshold_deg=10).solve(problem, RNG)
    residuals = problem.residuals(estimate.rotations)
    assert estimate.edge_weights is not None
    np.testing.assert_allclose(estimate.edge_weights, residuals < np.radians(10), atol=1e-3)
    assert estimate.cost == pytest.approx(np.minimum((residuals / np.radians(10)) ** 2, 1).sum())
    assert errors_deg(estimate.rotations, truth).max() < 1


def test_the_robust_cost_is_not_above_that_of_plain_reweighting() -> None:
    problem, _ = simulated(DENSE, noise_deg=5, outliers=0.4)
    graduated = GNC(loss="geman-mcclure", tolerance_deg=1e-4).solve(problem, RNG)
    plain = L1IRLS(tolerance_deg=1e-4).solve(problem, RNG)
    assert graduated.cost is not None
    assert plain.cost is not None
    assert graduated.cost <= 2 * plain.cost * (1 + 1e-6)


@EVERY_LOSS
def test_labels_and_edge_order_do_not_matter(loss: GncLoss) -> None:
    problem, _ = simulated(DENSE, noise_deg=3, outliers=0.2)
    other, order = transformed(problem)
    first, second = (GNC(loss=loss).solve(p, RNG).rotations for p in (problem, other))
    assert errors_deg(second, first[order]).max() < 1e-6


def test_nothing_to_reject() -> None:
    """Two cameras with one edge, and a ring on which no rotation fits: neither is an error."""
    problem, truth = simulated(random_edges(2, 1.0))
    assert errors_deg(GNC().solve(problem, RNG).rotations, truth).max() < 1e-6
    ring, _ = simulated(np.array([[0, 1], [1, 2], [0, 2]], dtype=np.int32), outliers=1.0)
    assert np.isfinite(GNC(threshold_deg=1e-3).solve(ring, RNG).rotations).all()


def test_a_limit_is_told() -> None:
    problem, _ = simulated(DENSE, noise_deg=3, outliers=0.3)
    estimate = GNC(iterations=3).solve(problem, RNG)
    assert (estimate.iterations, estimate.stop_reason) == (3, "iteration limit")


@pytest.mark.real_data
@EVERY_LOSS
def test_ellis_island(real_data: Path, loss: GncLoss) -> None:
    instance = load(OneDSfM(scene="Ellis_Island"), real_data / "1dsfm")
    assert instance.truth is not None
    errors = errors_deg(GNC(loss=loss).solve(instance.problem, RNG).rotations, instance.truth)
    assert errors.mean() < 3.1
    assert np.median(errors) < 0.62
