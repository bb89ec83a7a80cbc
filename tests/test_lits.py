"""LITS: its two forms against each other, what it is free of, and that it learns, the same every time."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated, transformed
from numpy.typing import NDArray

from bench import Instance, Problem, so3
from bench.learning.weights import write_weights
from bench.methods._lib.learned.directed import DirectedGraph
from bench.methods._lib.learned.lits import network
from bench.methods.lits import LITS

torch = pytest.importorskip("torch")

from bench.methods._lib.learned.lits import training  # noqa: E402 - it imports torch
from bench.methods._lib.learned.lits.torch_network import Lits  # noqa: E402
from bench.methods._lib.learned.torch_layers import TorchGraph  # noqa: E402

RNG = np.random.default_rng(0)  # the method draws nothing from it
GRAPHS = {
    "pair": np.array([[0, 1]], dtype=np.int32),
    "tree": np.array([[0, 1], [0, 2], [1, 3], [1, 4]], dtype=np.int32),
    "dense": random_edges(40, 0.5),
    "grid": grid_edges(5, 8),
}


def random_weights(seed: int = 0, scale: float = 1.0) -> dict[str, NDArray[np.float32]]:
    torch.manual_seed(seed)
    return {name: scale * p.detach().numpy() for name, p in Lits().named_parameters()}


@pytest.fixture
def method(tmp_path: Path) -> LITS:
    """It with weights that no one trained, larger than those that training begins with."""
    write_weights(tmp_path / "weights.npz", random_weights(scale=1.5), {"method": "lits"})
    return LITS(weights=str(tmp_path / "weights.npz"))


def upright(edges: NDArray[np.int32], seed: int = 0) -> Instance:
    """A graph of nearly upright cameras with noise and outliers."""
    problem, truth = simulated(edges, 3, 0.2, seed)
    cameras = so3.exp(np.random.default_rng(seed).normal(0, [0.1, 0.6, 0.05], (problem.n, 3)))
    i, j = problem.edges.T
    turned = np.swapaxes(truth, 1, 2)
    rotations = cameras[i] @ turned[i] @ problem.rotations @ truth[j] @ np.swapaxes(cameras[j], 1, 2)
    return Instance(replace(problem, rotations=rotations), cameras, name="upright")


@pytest.mark.parametrize("name", GRAPHS)
def test_both_forms_are_the_same_network(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(network, "_CHUNK", 50)
    problem, _ = simulated(GRAPHS[name], 5, 0.2)
    weights, graph = random_weights(scale=1.5), DirectedGraph.of(problem)
    trained = Lits()
    trained.load_state_dict({name: torch.from_numpy(array) for name, array in weights.items()})
    with torch.no_grad():
        steps = trained(TorchGraph(graph))
    assert len(steps) == network.ITERATIONS
    for count, (rotations, logits) in enumerate(steps, start=1):
        found, trust = network.solve(weights, graph, count)
        assert np.abs(found - rotations.numpy()).max() < 1e-5
        assert np.abs(trust - torch.sigmoid(logits).numpy()).max() < 1e-5
    assert np.abs(found - np.eye(3)).max() > 0.1


def test_it_has_as_many_parameters_as_published_and_those_of_the_longer_residual() -> None:
    assert sum(array.size for array in random_weights().values()) == 24_120 + 3 * 2 * network.HIDDEN


def test_names_and_order_do_not_matter(method: LITS) -> None:
    problem, _ = simulated(random_edges(40, 0.3), 5, 0.2)
    other, order = transformed(problem)
    first, second = method.solve(problem, RNG), method.solve(other, RNG)
    assert np.abs(first.rotations[order] - second.rotations).max() < 1e-5
    assert first.edge_weights is not None
    assert second.edge_weights is not None
    assert np.sort(first.edge_weights) == pytest.approx(np.sort(second.edge_weights), abs=1e-5)


def test_the_trust_in_an_edge_is_that_of_its_two_directions(method: LITS) -> None:
    problem, _ = simulated(GRAPHS["tree"], 5)
    graph = DirectedGraph.of(problem)
    _, trust = network.solve(method.trained().arrays, graph)
    weights = method.solve(problem, RNG).edge_weights
    assert weights is not None
    for edge in range(problem.m):
        assert weights[edge] == pytest.approx(trust[graph.edge == edge].mean())


def test_parallel_edges_count_each(method: LITS) -> None:
    problem, _ = simulated(GRAPHS["dense"], 5, 0.2)
    twice = Problem(problem.n, np.tile(problem.edges, (2, 1)), np.tile(problem.rotations, (2, 1, 1)))
    found = method.solve(twice, RNG)
    assert np.abs(found.rotations - method.solve(problem, RNG).rotations).max() < 1e-3
    assert found.edge_weights is not None


def test_thinning_keeps_graphs_connected() -> None:
    problem, _ = simulated(random_edges(60, 0.5))
    thin = training.thinned(problem, 100, np.random.default_rng(0))
    assert thin.m == 100
    assert not thin.components.any()
    tree = training.thinned(problem, 10, np.random.default_rng(0))
    assert tree.m == problem.n - 1
    assert training.thinned(thin, 100, np.random.default_rng(0)) is thin


def test_turned_frames_have_a_turned_truth() -> None:
    problem, truth = simulated(random_edges(20, 0.5), 1)
    turned, cameras = training.turned(problem, truth, np.random.default_rng(0))
    assert so3.angle_between(cameras, truth).max() > 0.1
    assert turned.residuals(cameras) == pytest.approx(problem.residuals(truth), abs=1e-7)


def test_the_loss_is_that_of_wrong_pairs_and_wrong_trust() -> None:
    """Of a network that never moves and trusts every edge by half."""
    graph = upright(random_edges(12, 0.6))
    assert graph.truth is not None
    still = Lits()
    with torch.no_grad():
        for parameter in still.parameters():
            parameter.zero_()
    i, j = graph.problem.edges.T
    measured, true = graph.problem.rotations, graph.truth[i] @ np.swapaxes(graph.truth[j], 1, 2)
    error = np.degrees(so3.angle_between(measured, true))
    known = ((error < 5) | (error > 15)).mean()
    pairs = np.eye(3) - graph.truth[:, None] @ np.swapaxes(graph.truth, 1, 2)
    assert not replace(
        graph.problem, edges=graph.problem.edges[error < 15], rotations=measured[error < 15]
    ).components.any()
    each = 0.2 * np.abs(pairs).sum(axis=(2, 3)).mean() + known * np.log(2)
    loss = float(training.loss_of(still, graph.problem, graph.truth).detach())
    assert loss == pytest.approx(each * sum(0.5**k for k in range(10)), rel=1e-3)


def taught(steps: int) -> Any:
    trainer = LITS().trainer(0)
    graphs = [upright(random_edges(15, 0.4), seed) for seed in range(5)]
    for step in range(steps):
        trainer.step([graphs[step % 5]], np.random.default_rng(step))
    return trainer


def test_what_it_learns_helps_on_other_graphs(tmp_path: Path) -> None:
    held_out = [upright(random_edges(15, 0.4), seed) for seed in range(100, 106)]

    def judged(trainer: Any) -> tuple[float, float]:
        write_weights(tmp_path / "weights.npz", trainer.weights(), {"method": "lits"})
        solver = LITS(weights=str(tmp_path / "weights.npz"))
        errors = [np.median(errors_deg(solver.solve(g.problem, RNG).rotations, g.truth)) for g in held_out]
        return float(np.mean([trainer.loss(graph) for graph in held_out])), float(np.mean(errors))

    before = judged(LITS().trainer(0))
    trainer = taught(60)
    after = judged(trainer)
    assert after[0] < 0.8 * before[0]
    assert after[1] < 0.5 * before[1]


def test_the_shipped_weights_average_many_edges_and_withstand_outliers() -> None:
    graph = upright(random_edges(50, 0.8))
    shipped = LITS()
    found = shipped.solve(graph.problem, RNG)
    assert graph.truth is not None
    assert found.edge_weights is not None
    wrong = graph.problem.residuals(graph.truth) > np.radians(20)
    assert 0.1 < wrong.mean() < 0.3
    assert errors_deg(found.rotations, graph.truth).max() < np.degrees(np.median(graph.problem.residuals(graph.truth)))
    assert np.median(found.edge_weights[wrong]) < 0.1 * np.median(found.edge_weights[~wrong])
    assert any(shipped.weights_hash[:8] in note for note in found.notes)
