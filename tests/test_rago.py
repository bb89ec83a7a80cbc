"""RAGO: its two forms against each other, what it is free of, what it leaves as it is, and that it learns."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated, transformed
from numpy.typing import NDArray

from bench import Instance, Problem, Skipped, catalog, so3
from bench.datasets.collection_graph import CollectionGraph
from bench.execution.here import solve_here
from bench.learning.weights import write_weights
from bench.methods._lib.learned.directed import DirectedGraph
from bench.methods._lib.learned.rago import network
from bench.methods.hara import HARA
from bench.methods.rago import RAGO

torch = pytest.importorskip("torch")

from bench.methods._lib.learned.rago import training  # noqa: E402 - it imports torch
from bench.methods._lib.learned.rago.torch_network import Rago  # noqa: E402
from bench.methods._lib.learned.torch_layers import TorchGraph  # noqa: E402

RNG = np.random.default_rng(0)  # the method draws nothing from it
GRAPHS = {
    "pair": np.array([[0, 1]], dtype=np.int32),
    "tree": np.array([[0, 1], [0, 2], [1, 3], [1, 4]], dtype=np.int32),
    "dense": random_edges(40, 0.5),
    "grid": grid_edges(5, 8),
}
LEARNED = random_edges(20, 0.8)


def random_weights() -> dict[str, NDArray[np.float32]]:
    """Weights of no training, far from those that it begins with, which change little."""
    torch.manual_seed(0)
    return {name: (p + 0.15 * torch.randn_like(p)).detach().numpy() for name, p in Rago().named_parameters()}


@pytest.fixture
def method(tmp_path: Path) -> RAGO:
    write_weights(tmp_path / "weights.npz", random_weights(), {"method": "rago"})
    return RAGO(weights=str(tmp_path / "weights.npz"))


def upright(edges: NDArray[np.int32], seed: int = 0) -> Instance:
    """A graph of nearly upright cameras with noise and outliers."""
    problem, truth = simulated(edges, 3, 0.2, seed)
    cameras = so3.exp(np.random.default_rng(seed).normal(0, [0.1, 0.6, 0.05], (problem.n, 3)))
    i, j = problem.edges.T
    turned = cameras @ np.swapaxes(truth, 1, 2)
    return Instance(
        replace(problem, rotations=turned[i] @ problem.rotations @ np.swapaxes(turned[j], 1, 2)), cameras, "upright"
    )


@pytest.mark.parametrize("name", GRAPHS)
def test_both_forms_are_the_same_network(name: str) -> None:
    problem, _ = simulated(GRAPHS[name], 5, 0.2)
    graph, start = DirectedGraph.of(problem), so3.to_quaternion(so3.random(np.random.default_rng(1), problem.n))
    weights, learned = random_weights(), Rago()
    learned.load_state_dict({name: torch.from_numpy(array) for name, array in weights.items()})
    with torch.no_grad():
        moved, rectified = learned(TorchGraph(graph), torch.from_numpy(start).float(), 2, 3)
    assert (len(moved), len(rectified)) == (6, 2)
    found = network.solve(weights, graph, start, 2, 3)
    for ours, theirs in ((found.cameras, moved[-1]), (found.edges, rectified[-1])):
        assert np.abs(so3.from_quaternion(ours) - so3.from_quaternion(theirs.numpy())).max() < 1e-5
    assert np.abs(so3.from_quaternion(found.cameras) - so3.from_quaternion(start)).max() > 0.1
    assert np.abs(so3.from_quaternion(found.edges) - graph.rotations).max() > 0.01


def test_names_and_order_do_not_matter(method: RAGO) -> None:
    problem, _ = simulated(random_edges(40, 0.3), 5, 0.2)
    other, order = transformed(problem)
    first, second = method.solve(problem, RNG), method.solve(other, RNG)
    assert np.abs(first.rotations[order] - second.rotations).max() < 1e-5
    assert first.edge_weights is not None
    assert second.edge_weights is not None
    np.testing.assert_allclose(np.sort(first.edge_weights), np.sort(second.edge_weights), rtol=1e-3)


def test_a_turned_world_turns_the_answer() -> None:
    problem, _ = simulated(random_edges(40, 0.3), 5, 0.2)
    graph, start = DirectedGraph.of(problem), so3.random(np.random.default_rng(1), problem.n)
    turn = so3.exp(np.array([1.0, -2.0, 0.5]))
    first, second = (
        so3.from_quaternion(network.solve(random_weights(), graph, so3.to_quaternion(cameras), 2).cameras)
        for cameras in (start, start @ turn)
    )
    assert np.abs(first @ turn - second).max() < 1e-5


@pytest.mark.parametrize("name", GRAPHS)
def test_what_is_exact_stays_exact(name: str, method: RAGO) -> None:
    problem, truth = simulated(GRAPHS[name])
    assert errors_deg(method.solve(problem, RNG).rotations, truth).max() < 1e-6


def test_a_tree_is_fitted_whatever_its_measurements(method: RAGO) -> None:
    problem, _ = simulated(GRAPHS["tree"], 30)
    assert np.degrees(problem.residuals(method.solve(problem, RNG).rotations)).max() < 1e-6


def test_without_steps_it_is_the_tree_of_triangles(method: RAGO) -> None:
    problem, _ = simulated(GRAPHS["dense"], 5, 0.2)
    still = replace(method, outer=0).solve(problem, RNG)
    tree = HARA(filter_deg=180, irls_iterations=0).solve(problem, RNG)
    assert np.abs(still.rotations - tree.rotations).max() < 1e-12
    assert method.solve(problem, RNG).iterations == 5 * network.CAMERA_UPDATES


def test_cameras_of_another_component_are_left_out(method: RAGO) -> None:
    edges = np.array([[0, 1], [0, 2], [1, 2], [3, 4]], dtype=np.int32)
    problem, truth = simulated(edges)
    found = solve_here(catalog("method")["rago"], {"weights": method.weights}, problem).rotations
    assert np.isnan(found[3:]).all()
    assert errors_deg(found[:3], truth[:3]).max() < 1e-6


def test_it_needs_weights(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(RAGO, "weights_file", tmp_path / "none.npz")
    problem, _ = simulated(GRAPHS["tree"])
    with pytest.raises(Skipped, match="`bench train rago` makes its weights"):
        RAGO().solve(problem, RNG)


def test_thinning_keeps_graphs_connected() -> None:
    graph = upright(random_edges(60, 0.5))
    thin, truth = training.thinned(graph, np.random.default_rng(0))
    assert 0.8 * graph.problem.m - 1 <= len(thin.at) / 2 <= 0.8 * graph.problem.m + graph.problem.n
    assert truth is graph.truth
    tree, _ = training.thinned(upright(GRAPHS["tree"]), np.random.default_rng(0))
    assert len(tree.at) == 2 * len(GRAPHS["tree"])


def test_the_loss_is_nothing_at_the_truth_and_much_elsewhere() -> None:
    problem, truth = simulated(GRAPHS["dense"])
    exact = training.thinned(Instance(problem, truth, "exact"), np.random.default_rng(0))
    assert float(training.loss_of(Rago(), exact, truth).detach()) == pytest.approx(0, abs=1e-2)
    elsewhere = so3.random(np.random.default_rng(9), problem.n)
    assert float(training.loss_of(Rago(), exact, elsewhere).detach()) > 1


def taught(steps: int) -> Any:
    trainer = RAGO().trainer(0)
    graphs = [upright(LEARNED, seed) for seed in range(5)]
    for step in range(steps):
        trainer.step([graphs[step % 5]], np.random.default_rng(step))
    return trainer


def test_what_it_learns_helps_on_other_graphs() -> None:
    held_out = [upright(LEARNED, seed) for seed in range(100, 106)]
    before = np.mean([RAGO().trainer(0).loss(graph) for graph in held_out])
    trainer = taught(60)
    assert np.mean([trainer.loss(graph) for graph in held_out]) < 0.9 * before


@pytest.fixture
def parallel() -> Problem:
    problem, _ = simulated(GRAPHS["dense"], 5, 0.2)
    return Problem(problem.n, np.tile(problem.edges, (2, 1)), np.tile(problem.rotations, (2, 1, 1)))


def test_parallel_edges_are_fused(parallel: Problem, method: RAGO) -> None:
    found = solve_here(catalog("method")["rago"], {"weights": method.weights}, parallel)
    assert found.edge_weights is not None
    assert len(found.edge_weights) == parallel.m


def test_the_shipped_weights_are_much_better_than_their_start() -> None:
    graphs = [next(CollectionGraph(60).sources(None, seed)).load() for seed in range(4)]

    def error(outer: int) -> float:
        found = [RAGO(outer=outer).solve(graph.problem, RNG).rotations for graph in graphs]
        return float(np.mean([np.median(errors_deg(f, g.truth)) for f, g in zip(found, graphs, strict=True)]))

    assert error(5) < 0.75 * error(0)
