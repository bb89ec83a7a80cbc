"""L1-IRLS: its parts against references, and what it recovers."""

from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated, transformed

from bench.core import so3
from bench.core.problem import Ints
from bench.methods._lib.descent.losses import LOSSES
from bench.methods._lib.linear import laplacian
from bench.methods._lib.linear.laplacian import LaplacianSolver
from bench.methods._lib.loops import edge_kernels
from bench.methods.l1_irls import L1IRLS, LossName
from bench.methods.spectral import Spectral

RNG = np.random.default_rng(0)  # the method draws nothing from it
DENSE = random_edges(60, 0.4)
SPARSE = random_edges(250, 0.03)
GRID = grid_edges(10, 25)
EVERY_GRAPH = pytest.mark.parametrize("edges", [DENSE, SPARSE, GRID], ids=["dense", "sparse", "grid"])


@pytest.mark.parametrize("name", LOSSES)
def test_weights_are_derivatives_of_the_losses(name: str) -> None:
    loss = LOSSES[name]
    x = np.linspace(0.05, 0.95, 40) if name == "talwar" else np.linspace(0.053, 4.053, 401)
    step = 1e-6
    derivative = (loss.value(x + step) - loss.value(x - step)) / (2 * step)
    wanted = loss.weight(x) * x
    constant = derivative[0] / wanted[0]
    np.testing.assert_allclose(derivative, constant * wanted, atol=1e-8)


def test_every_loss_can_be_chosen() -> None:
    assert set(get_args(LossName)) == set(LOSSES)


def test_residuals_are_those_of_the_matrices() -> None:
    problem, _ = simulated(DENSE, outliers=1.0)
    cameras = so3.random(np.random.default_rng(1), problem.n)
    vectors, angles, measured = np.empty((problem.m, 3)), np.empty(problem.m), np.empty((problem.m, 4))
    edge_kernels.quaternions(problem.rotations, measured)
    np.testing.assert_allclose(so3.from_quaternion(measured), problem.rotations, atol=1e-14)
    edge_kernels.edge_residuals(problem.edges, measured, so3.to_quaternion(cameras), vectors, angles)
    i, j = problem.edges.T
    wanted = so3.log(np.swapaxes(cameras[i], -1, -2) @ problem.rotations @ cameras[j])
    np.testing.assert_allclose(vectors, wanted, atol=1e-12)
    np.testing.assert_allclose(angles, np.linalg.norm(wanted, axis=1), atol=1e-12)


def test_quaternions_and_angles_of_half_turns_and_of_none() -> None:
    axes = np.concatenate([np.eye(3), np.ones((1, 3)) / np.sqrt(3)])
    for angle in (0.0, 1e-9, np.pi - 1e-9, np.pi):
        rotations = so3.exp(angle * axes)
        edges = np.stack([np.zeros(4), np.arange(1, 5)], axis=1).astype(np.int32)
        measured, vectors, angles = np.empty((4, 4)), np.empty((4, 3)), np.empty(4)
        edge_kernels.quaternions(rotations, measured)
        np.testing.assert_allclose(so3.from_quaternion(measured), rotations, atol=1e-14)
        cameras = np.tile([1.0, 0, 0, 0], (5, 1))
        edge_kernels.edge_residuals(edges, measured, cameras, vectors, angles)
        np.testing.assert_allclose(angles, angle, atol=1e-14, rtol=1e-6)
        np.testing.assert_allclose(so3.exp(vectors), rotations, atol=1e-14)


def test_turning_cameras() -> None:
    rng = np.random.default_rng(0)
    cameras, steps = so3.random(rng, 20), rng.standard_normal((20, 3))
    steps[0] = 0
    turned = so3.to_quaternion(cameras)
    edge_kernels.turn(steps, turned)
    np.testing.assert_allclose(so3.from_quaternion(turned), cameras @ so3.exp(steps), atol=1e-14)


@EVERY_GRAPH
def test_laplacian_solutions_are_least_squares(edges: Ints) -> None:
    problem, _ = simulated(edges)
    solver = LaplacianSolver(problem)
    rng = np.random.default_rng(1)
    for _ in range(2):
        weights, vectors = rng.uniform(0.1, 2, problem.m), rng.standard_normal((problem.m, 3))
        x = solver.solve(weights, vectors)
        incidence = np.zeros((problem.m, problem.n))
        incidence[np.arange(problem.m), edges[:, 0]] = 1
        incidence[np.arange(problem.m), edges[:, 1]] = -1
        root = np.sqrt(weights)[:, None]
        wanted = np.linalg.lstsq(root * incidence, root * vectors, rcond=None)[0]
        np.testing.assert_allclose(x, wanted, atol=1e-9)
        inverse = solver.inverse(weights)
        for right in (incidence.T @ (root**2 * vectors), incidence.T @ root):
            columns = (incidence.T * weights) @ incidence @ inverse(right)
            np.testing.assert_allclose(columns, right, atol=1e-9)


def test_along_sequences_factors_are_dense_in_a_band_and_say_the_same() -> None:
    """With parallel edges, and in whatever order the cameras are numbered."""
    problem, _ = simulated(np.concatenate([GRID, GRID[::7]]))
    problem, _ = transformed(problem)
    rng = np.random.default_rng(1)
    weights, right = rng.uniform(0.1, 2, problem.m), rng.standard_normal((problem.n - 1, 3))
    degrees = np.bincount(problem.edges.ravel(), np.repeat(weights, 2))
    banded, sparse = laplacian._factored(problem), laplacian._SparseSystem(problem)
    assert isinstance(banded, laplacian._BandedSystem)
    assert isinstance(laplacian._factored(simulated(SPARSE)[0]), laplacian._SparseSystem)
    np.testing.assert_allclose(
        banded.solve(weights, degrees, right), sparse.solve(weights, degrees, right), rtol=1e-9, atol=1e-9
    )


def test_large_graphs_are_solved_by_conjugate_gradients_to_the_tolerance(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(laplacian, "LARGE", 200)
    problem, _ = simulated(random_edges(250, 0.2))
    rng = np.random.default_rng(1)
    weights, vectors = rng.uniform(0.1, 2, problem.m), rng.standard_normal((problem.m, 3))
    exact = LaplacianSolver(problem).solve(weights, vectors)
    for tolerance in (0.1, 1e-4):
        found = LaplacianSolver(problem, tolerance).solve(weights, vectors)
        error = np.linalg.norm(found - exact) / np.linalg.norm(exact)
        assert 1e-9 < error < 3 * tolerance
        right = np.eye(problem.n)[:, :4] - 1 / problem.n
        approximate, wanted = (LaplacianSolver(problem, t).inverse(weights)(right) for t in (tolerance, 0.0))
        assert np.linalg.norm(approximate - wanted) < 3 * tolerance * np.linalg.norm(wanted)
    monkeypatch.setattr(laplacian, "MOST_PRODUCTS", 1)
    np.testing.assert_allclose(LaplacianSolver(problem, 1e-4).solve(weights, vectors), exact, atol=1e-12)


def test_large_graphs_are_solved_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, truth = simulated(random_edges(250, 0.2), noise_deg=3, outliers=0.3)
    exact = L1IRLS().solve(problem, RNG)
    monkeypatch.setattr(laplacian, "LARGE", 200)
    found = L1IRLS().solve(problem, RNG)
    assert not np.array_equal(found.rotations, exact.rotations)
    assert errors_deg(found.rotations, exact.rotations).max() < 0.05
    assert np.mean(errors_deg(found.rotations, truth)) < 1


@EVERY_GRAPH
@pytest.mark.parametrize("init", ["spectral", "spanning-tree"])
@pytest.mark.parametrize("loss", ["geman-mcclure", "l-half", "talwar"])
def test_noise_free_problems_are_solved_exactly(edges: Ints, init: str, loss: str) -> None:
    problem, truth = simulated(edges)
    estimate = L1IRLS(init=init, loss=loss).solve(problem, RNG)  # type: ignore[arg-type]
    assert errors_deg(estimate.rotations, truth).max() < 1e-8


@pytest.mark.parametrize("init", ["spectral", "spanning-tree"])
def test_outliers_are_rejected(init: str) -> None:
    problem, truth = simulated(DENSE, outliers=0.4)
    assert np.median(errors_deg(Spectral().solve(problem, RNG).rotations, truth)) > 1
    estimate = L1IRLS(init=init).solve(problem, RNG)  # type: ignore[arg-type]
    assert errors_deg(estimate.rotations, truth).max() < 0.02
    exact = L1IRLS(init=init, loss="l-half", tolerance_deg=1e-8, irls_iterations=500)  # type: ignore[arg-type]
    assert errors_deg(exact.solve(problem, RNG).rotations, truth).max() < 1e-5


@pytest.mark.parametrize("loss", sorted(set(LOSSES) - {"l2"}))
def test_every_robust_loss_beats_least_squares(loss: str) -> None:
    problem, truth = simulated(DENSE, noise_deg=2, outliers=0.3)
    estimate = L1IRLS(loss=loss).solve(problem, RNG)  # type: ignore[arg-type]
    squares = L1IRLS(loss="l2").solve(problem, RNG)
    assert errors_deg(estimate.rotations, truth).mean() < 0.5 * errors_deg(squares.rotations, truth).mean()


@EVERY_GRAPH
@pytest.mark.parametrize("init", ["spectral", "spanning-tree"])
def test_labels_and_edge_order_do_not_matter(edges: Ints, init: str) -> None:
    problem, _ = simulated(edges, noise_deg=3, outliers=0.1)
    other, order = transformed(problem)
    method = L1IRLS(init=init)  # type: ignore[arg-type]
    first, second = method.solve(problem, RNG).rotations, method.solve(other, RNG).rotations
    assert errors_deg(second, first[order]).max() < 1e-6


def test_the_estimate_says_how_it_came_about() -> None:
    problem, _ = simulated(DENSE, noise_deg=2, outliers=0.3)
    method = L1IRLS(tolerance_deg=1e-6, irls_iterations=300)
    estimate = method.solve(problem, RNG)
    assert estimate.edge_weights is not None
    assert estimate.iterations is not None
    assert estimate.stop_reason == "mean step below 1e-06 degrees"
    squared = (problem.residuals(estimate.rotations) / np.radians(5)) ** 2
    assert estimate.cost == pytest.approx((squared / (1 + squared)).sum() / 2)
    np.testing.assert_allclose(estimate.edge_weights, (1 + squared) ** -2, rtol=1e-6)
    stopped = replace(method, irls_iterations=2).solve(problem, RNG)
    assert stopped.stop_reason == "iteration limit"
    assert stopped.cost is not None
    assert estimate.cost < stopped.cost


@pytest.mark.real_data
def test_ellis_island(real_data: Path) -> None:
    from bench.datasets.one_dsfm import OneDSfM

    sources = OneDSfM(scene="Ellis_Island").sources(real_data / "1dsfm", 0)
    instance = next(iter(sources)).load()  # type: ignore[union-attr]
    assert instance.truth is not None
    spectral = errors_deg(Spectral().solve(instance.problem, RNG).rotations, instance.truth)
    assert 2.5 < np.median(spectral) < 3.0
    for loss in ("geman-mcclure", "l-half"):
        found = errors_deg(L1IRLS(loss=loss).solve(instance.problem, RNG).rotations, instance.truth)  # type: ignore[arg-type]
        assert found.mean() <= 3.1
        assert np.median(found) <= 0.60
