"""DMF-Synch: exact without noise, robust where spectral is not, and in its dense form the paper's recipe."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated, transformed

from bench.core.problem import Checkpoint, Ints
from bench.datasets.one_dsfm import OneDSfM
from bench.methods._lib.dmf import dmf_thin
from bench.methods._lib.dmf.dmf_dense import DenseFactorization
from bench.methods.dmf_synch import DMFSynch
from bench.methods.spectral import Spectral
from bench.plugins.declare import Source

NOISY = random_edges(60, 0.5)
RING = np.array([[k, k + 1] for k in range(29)] + [[0, 29]], dtype=np.int32)
GRAPHS = {
    "pair": np.array([[0, 1]], dtype=np.int32),
    "small": random_edges(8, 0.2),
    "complete": random_edges(30, 1.0),
    "sparse": random_edges(30, 0.05),
    "grid": grid_edges(4, 8),
    "ring": RING,
}
EVERY_GRAPH = pytest.mark.parametrize("edges", GRAPHS.values(), ids=GRAPHS)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@EVERY_GRAPH
@pytest.mark.parametrize("loss", ["l1", "l2", "l1/2"])
def test_noise_free_problems_are_solved(edges: Ints, loss: str) -> None:
    problem, truth = simulated(edges)
    assert errors_deg(DMFSynch(loss=loss).solve(problem, rng()).rotations, truth).max() < 1e-2  # type: ignore[arg-type]


@pytest.mark.parametrize("depth", [2, 3, 5])
def test_outliers_cost_little_at_any_depth(depth: int) -> None:
    problem, truth = simulated(NOISY, noise_deg=2, outliers=0.4)
    spectral = errors_deg(Spectral().solve(problem, rng()).rotations, truth).mean()
    for loss in ("l1/2", "l1"):
        error = errors_deg(DMFSynch(depth=depth, loss=loss).solve(problem, rng()).rotations, truth).mean()  # type: ignore[arg-type]
        assert error < 1.5 < 4 < spectral


@pytest.mark.parametrize("depth", [2, 3, 5])
def test_a_random_start_reaches_the_same_minimum(depth: int) -> None:
    problem, _ = simulated(NOISY, noise_deg=2, outliers=0.3)
    from_spectral = DMFSynch(depth=depth).solve(problem, rng())
    from_nothing = DMFSynch(depth=depth, init="random").solve(problem, rng())
    assert errors_deg(from_nothing.rotations, from_spectral.rotations).max() < 0.1


@pytest.mark.parametrize("init", ["spanning-tree", "cemp-mst"])
def test_other_starts_reach_the_same_minimum(init: Literal["spanning-tree", "cemp-mst"]) -> None:
    problem, _ = simulated(NOISY, noise_deg=2, outliers=0.2)
    expected = DMFSynch().solve(problem, rng()).rotations
    assert errors_deg(DMFSynch(init=init).solve(problem, rng()).rotations, expected).max() < 0.1


def test_relabelling_edge_order_and_direction_do_not_matter() -> None:
    problem, _ = simulated(NOISY, noise_deg=5, outliers=0.2)
    other, order = transformed(problem)
    first, second = DMFSynch().solve(problem, rng(0)), DMFSynch().solve(other, rng(1))
    assert errors_deg(second.rotations, first.rotations[order]).max() < 1e-2


def test_a_wider_product_still_gives_rotations() -> None:
    problem, truth = simulated(NOISY, noise_deg=2, outliers=0.2)
    estimate = DMFSynch(width=5).solve(problem, rng())
    assert errors_deg(estimate.rotations, truth).mean() < 2
    assert estimate.checkpoints[-1].diagnostics["sigma_4"] > 0


@pytest.mark.parametrize("loss", ["l1", "l2", "l1/2"])
def test_the_edge_kernel_is_the_gradient_of_the_loss(loss: dmf_thin.Loss) -> None:
    """Against finite differences of the loss, written out with full matrices in double precision."""
    problem, _ = simulated(random_edges(9, 0.5), noise_deg=20)
    observed, width, scale = dmf_thin.Observed.of(problem), 4, 0.3
    left, right = rng(1).standard_normal((2, 9, 3 * width))
    seen = np.kron((problem.adjacency().toarray() + np.eye(9)), np.ones((3, 3)))
    measured = problem.block_matrix(diagonal=np.ones(9)).toarray()

    def total(a: np.ndarray) -> float:
        residual = seen * (a.reshape(-1, width) @ right.reshape(-1, width).T - measured)
        squares = (residual**2).reshape(9, 3, 9, 3).sum(axis=(1, 3))
        present = seen[::3, ::3] > 0
        if loss == "l2":
            return float(squares.sum() / 2)
        if loss == "l1":
            return float(np.sqrt(residual[seen > 0] ** 2 + scale**2).sum())
        return float(2 * np.sqrt(scale) * ((squares[present] + scale**2) ** 0.25).sum())

    sums = np.empty((9, 3 * width), np.float32)
    dmf_thin.edge_kernel(width, loss)(
        observed.first,
        observed.neighbour,
        observed.blocks,
        left.astype(np.float32),
        right.T.astype(np.float32).copy(),
        np.float32(scale),
        sums,
    )
    for _ in range(5):
        direction = rng(2).standard_normal(left.shape)
        slope = (total(left + 1e-5 * direction) - total(left - 1e-5 * direction)) / 2e-5
        assert (sums * direction).sum() == pytest.approx(slope, rel=1e-4, abs=1e-3)


def test_the_dense_start_is_the_papers() -> None:
    problem, _ = simulated(random_edges(40, 0.5))
    network = DenseFactorization(problem, depth=3, width=120, init_scale=1e-3, seed=0, device="cpu")
    assert len(network.layers) == 3
    assert float(network.layers[1].std()) == pytest.approx(1e-3 ** (1 / 3) / np.sqrt(120), rel=0.02)
    assert float(network.products()[-1].norm()) == pytest.approx(1e-3 * np.sqrt(120), rel=0.1)


@pytest.mark.parametrize("loss", ["l1", "l2"])
def test_the_dense_step_is_autograds(loss: str) -> None:
    import torch

    problem, _ = simulated(random_edges(6, 0.5))
    network = DenseFactorization(problem, depth=4, width=18, init_scale=1.0, seed=0, device="cpu")
    layers = [layer.clone().requires_grad_() for layer in network.layers]
    optimizer = torch.optim.SGD(layers, lr=0.3, momentum=0.9)
    target = torch.tensor(problem.block_matrix(diagonal=np.ones(6)).toarray(), dtype=torch.float32)
    seen = torch.tensor(np.kron(problem.adjacency().toarray() + np.eye(6), np.ones((3, 3))) > 0)
    criterion = torch.nn.L1Loss() if loss == "l1" else torch.nn.MSELoss()
    for _ in range(3):
        optimizer.zero_grad()
        product = layers[0] @ layers[1] @ layers[2] @ layers[3]
        criterion(product[seen], target[seen]).backward()
        optimizer.step()
        network.step(loss, lr=0.3, momentum=0.9)  # type: ignore[arg-type]
    for ours, theirs in zip(network.layers, layers, strict=True):
        torch.testing.assert_close(ours, theirs.detach())


def test_the_dense_form_is_stopped_before_it_fits_the_outliers() -> None:
    problem, truth = simulated(random_edges(30, 0.8), noise_deg=2, outliers=0.3)
    honest = DMFSynch(preset="dense", checkpoint_every=100, iterations=6000).solve(problem, rng())
    assert honest.iterations is not None
    assert honest.iterations < 6000
    assert "began to fit outliers" in honest.stop_reason
    by_error = [errors_deg(c.rotations, truth).mean() for c in honest.checkpoints]
    assert errors_deg(honest.rotations, truth).mean() < min(by_error) + 0.3
    late = DMFSynch(preset="dense", stop="limit", iterations=6000).solve(problem, rng())
    assert late.stop_reason == "iteration limit"
    assert errors_deg(late.rotations, truth).mean() > 2 * errors_deg(honest.rotations, truth).mean()


def test_the_seed_decides_the_dense_start() -> None:
    problem, _ = simulated(random_edges(8, 0.5))
    method = DMFSynch(preset="dense", iterations=3, stop="limit")
    first, again, other = (method.solve(problem, rng(seed)).rotations for seed in (5, 5, 6))
    assert np.array_equal(first, again)
    assert not np.allclose(first, other)


def test_checkpoints_tell_iteration_seconds_and_singular_values() -> None:
    problem, _ = simulated(random_edges(8, 0.5))
    for method in (DMFSynch(iterations=250), DMFSynch(preset="dense", iterations=250, checkpoint_every=100)):
        checkpoints: tuple[Checkpoint, ...] = method.solve(problem, rng()).checkpoints
        assert [c.iteration for c in checkpoints][:3] == [0, 100, 200]
        assert all(np.diff([c.seconds for c in checkpoints]) > 0)
        assert {"cost", "sigma_1", "sigma_2", "sigma_3"} <= checkpoints[0].diagnostics.keys()
        assert checkpoints[0].rotations.shape == (8, 3, 3)


@pytest.mark.real_data
@pytest.mark.parametrize("depth", [2, 3, 4, 5])
@pytest.mark.parametrize(("loss", "median"), [("l1/2", 0.6), ("l1", 0.8)])
def test_ellis_island(depth: int, loss: str, median: float, real_data: Path) -> None:
    source = next(iter(OneDSfM(scene="Ellis_Island").sources(real_data / "1dsfm", 0)))
    assert isinstance(source, Source)
    instance = source.load()
    estimate = DMFSynch(depth=depth, loss=loss).solve(instance.problem, rng())  # type: ignore[arg-type]
    assert instance.truth is not None
    errors = errors_deg(estimate.rotations, instance.truth)
    assert np.median(errors) < median
    assert errors.mean() < 2.95


def test_the_paper_preset_is_the_dense_recipe_to_its_end():
    problem, _ = simulated(random_edges(6, 0.8))
    paper = DMFSynch(preset="paper", iterations=2500).solve(problem, rng())
    assert [c.iteration for c in paper.checkpoints] == [0, 1000, 2000, 2500]
    assert paper.iterations == 2500
    assert DMFSynch(preset="paper").layers == 5
    same = DMFSynch(preset="dense", depth=5, stop="limit", iterations=2500).solve(problem, rng())
    np.testing.assert_array_equal(paper.rotations, same.rotations)
