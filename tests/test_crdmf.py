"""CRDMF: its gradients, its filter and reweighting, and what both presets recover."""

from pathlib import Path

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated, transformed

from bench.core.problem import Ints
from bench.methods._lib.dmf import dmf_thin
from bench.methods._lib.dmf.crdmf_dense import SymmetricFactorization
from bench.methods._lib.graph.all_triangles import AllTriangles
from bench.methods.crdmf import CRDMF, agrees_with_tree, reweighted
from bench.methods.spectral import Spectral
from bench.plugins.declare import Source

NOISY = random_edges(60, 0.5)
GRAPHS = {
    "pair": np.array([[0, 1]], dtype=np.int32),
    "complete": random_edges(20, 1.0),
    "sparse": random_edges(30, 0.1),
    "grid": grid_edges(4, 8),
}


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.mark.parametrize("edges", GRAPHS.values(), ids=GRAPHS)
@pytest.mark.parametrize("init", ["spectral", "spanning-tree"])
def test_noise_free_problems_are_solved(edges: Ints, init: str) -> None:
    problem, truth = simulated(edges)
    assert errors_deg(CRDMF(init=init).solve(problem, rng()).rotations, truth).max() < 1e-2  # type: ignore[arg-type]


def test_the_filter_keeps_inliers_and_drops_outliers() -> None:
    problem, truth = simulated(NOISY, noise_deg=2, outliers=0.15)
    kept = agrees_with_tree(problem, AllTriangles.of(problem))
    residuals = problem.residuals(truth)
    assert kept[residuals < np.radians(25)].all()
    assert not kept[residuals > np.radians(60)].any()


def test_weights_fall_with_the_error_beyond_the_median() -> None:
    problem, truth = simulated(NOISY, noise_deg=5)
    factors, residuals = reweighted(problem, truth), problem.residuals(truth)
    median = np.median(residuals)
    np.testing.assert_array_equal(factors[residuals < median], 1)
    beyond = residuals > median
    np.testing.assert_allclose(factors[beyond], np.sin(median / 2) / np.sin(residuals[beyond] / 2), rtol=1e-2)


def test_outliers_cost_little() -> None:
    problem, truth = simulated(NOISY, noise_deg=2, outliers=0.15)
    estimate = CRDMF().solve(problem, rng())
    spectral = errors_deg(Spectral().solve(problem, rng()).rotations, truth).mean()
    assert errors_deg(estimate.rotations, truth).mean() < 1.3 < spectral
    assert estimate.edge_weights is not None
    assert (estimate.edge_weights[problem.residuals(truth) > np.radians(60)] == 0).all()
    assert estimate.edge_weights.max() == 1


def test_the_candidate_with_the_smallest_misfit_is_kept() -> None:
    problem, _ = simulated(NOISY, noise_deg=5, outliers=0.3)
    estimate = CRDMF(init="random", candidates=6).solve(problem, rng())
    assert [c.diagnostics["depth"] for c in estimate.checkpoints] == [1, 2, 3, 4, 2, 3]
    best = min(estimate.checkpoints, key=lambda c: c.diagnostics["misfit"])
    np.testing.assert_array_equal(estimate.rotations, best.rotations)
    assert estimate.notes[0] == f"kept depth {best.diagnostics['depth']:g} of 6 candidates"


def test_relabelling_edge_order_and_direction_do_not_matter() -> None:
    problem, _ = simulated(NOISY, noise_deg=5, outliers=0.2)
    other, order = transformed(problem)
    first, second = CRDMF(candidates=1).solve(problem, rng(0)), CRDMF(candidates=1).solve(other, rng(1))
    assert errors_deg(second.rotations, first.rotations[order]).max() < 0.05


def test_weighted_blocks_are_in_the_thin_gradient() -> None:
    """A block of weight zero might as well not be there; doubled weights double the gradient."""
    problem, _ = simulated(random_edges(9, 0.6), noise_deg=20)
    observed, generator = dmf_thin.Observed.of(problem), rng(1)
    left = generator.standard_normal((9, 9)).astype(np.float32)
    weights = generator.uniform(0.5, 2, len(observed.neighbour)).astype(np.float32)

    def sums(*weights: dmf_thin.Single) -> tuple[float, np.ndarray]:
        filled = np.empty((9, 9), np.float32)
        graph = observed.first, observed.neighbour, observed.blocks
        return dmf_thin.edge_kernel(3, "l1")(*graph, left, left.T.copy(), np.float32(0.1), filled, *weights), filled

    plain_cost, plain = sums()
    ones_cost, ones = sums(np.ones_like(weights))
    assert ones_cost == pytest.approx(plain_cost, rel=1e-6)
    np.testing.assert_allclose(ones, plain, rtol=1e-5, atol=1e-5)
    single = np.zeros_like(weights)
    total = np.zeros_like(plain, dtype=float)
    for k, weight in enumerate(weights):
        single[:] = 0
        single[k] = weight
        total += sums(single)[1]
    np.testing.assert_allclose(sums(weights)[1], total, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("depth", [1, 3])
def test_the_dense_step_is_autograds(depth: int) -> None:
    import torch

    problem, _ = simulated(random_edges(6, 0.5))
    network = SymmetricFactorization(problem, depth=depth, init_scale=1.0, seed=0, device="cpu")
    weights = rng(1).uniform(0.5, 2, problem.m)
    network.weigh(weights)
    layers = [layer.clone().requires_grad_() for layer in network.layers]
    columns = torch.linalg.multi_dot(layers) if depth > 1 else layers[0]
    matrix = np.eye(6)
    i, j = problem.edges.T
    matrix[i, j] = matrix[j, i] = weights
    share = torch.tensor(np.kron(matrix, np.ones((3, 3))), dtype=torch.float32)
    measured = torch.tensor(problem.block_matrix(diagonal=np.ones(6)).toarray(), dtype=torch.float32)
    loss = ((columns @ columns.T - measured).abs() * share).sum() / (9 * (2 * problem.m + 6))
    assert network.cost() == pytest.approx(float(loss.detach()), rel=1e-5)
    loss.backward()
    network.step(0.5, 0.9)
    for layer, found in zip(layers, network.layers, strict=True):
        assert layer.grad is not None
        np.testing.assert_allclose(found, (layer - 0.5 * layer.grad).detach(), atol=1e-6)


def test_the_dense_start_is_the_papers() -> None:
    problem, _ = simulated(random_edges(40, 0.5))
    network = SymmetricFactorization(problem, depth=3, init_scale=1e-3, seed=0, device="cpu")
    columns = network.columns()
    assert float(network.layers[0].std()) == pytest.approx(1e-3 ** (1 / 6) / np.sqrt(120), rel=0.02)
    assert np.linalg.norm(columns @ columns.T) == pytest.approx(1e-3 * np.sqrt(120), rel=0.5)


def test_the_paper_preset_withstands_outliers() -> None:
    problem, truth = simulated(random_edges(30, 0.6), noise_deg=2, outliers=0.15)
    estimate = CRDMF(preset="paper", candidates=2, iterations=2000).solve(problem, rng())
    assert np.median(errors_deg(estimate.rotations, truth)) < 2


@pytest.mark.real_data
def test_ellis_island(real_data: Path) -> None:
    from bench.datasets.one_dsfm import OneDSfM

    source = next(iter(OneDSfM(scene="Ellis_Island").sources(real_data / "1dsfm", 0)))
    assert isinstance(source, Source)
    instance = source.load()
    assert instance.truth is not None
    errors = errors_deg(CRDMF(candidates=1).solve(instance.problem, rng()).rotations, instance.truth)
    assert errors.mean() < 2.4
    assert np.median(errors) < 0.55
