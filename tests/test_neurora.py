"""NeuRoRA: the networks in torch and in numpy, the tree between them, the method, and its training."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import torch
from graphs import errors_deg, grid_edges, random_edges, simulated, transformed

from bench import Floats, Instance, Problem, so3
from bench.datasets.neurora_graphs import NeuRoRAGraphs
from bench.learning.weights import write_weights
from bench.methods._lib.graph.trees import hub, propagated
from bench.methods._lib.learned.directed import DirectedGraph
from bench.methods._lib.learned.neurora.networks import clean_net, fine_net
from bench.methods._lib.learned.neurora.torch_networks import CleanNet, FineNet
from bench.methods._lib.learned.neurora.tree import both_ways, inlier_tree, kept_edges, start_rotations
from bench.methods._lib.learned.torch_layers import TorchGraph
from bench.methods._lib.learned.torch_quaternions import product, unit
from bench.methods.neurora import NeuRoRA


def arrays_of(network: torch.nn.Module) -> dict[str, Any]:
    return {name: p.detach().numpy() for name, p in network.named_parameters()}


def noisy(seed: int = 0) -> Problem:
    return simulated(random_edges(12, 0.4, seed), noise_deg=10, outliers=0.2, seed=seed)[0]


def learned_from(seed: int) -> Instance:
    (source,) = NeuRoRAGraphs(20, 30).sources(None, seed)
    return source.load()


@pytest.fixture(scope="module")
def random_weights(tmp_path_factory: pytest.TempPathFactory) -> NeuRoRA:
    """The method with weights that were never trained; those of the last layer of FineNet, which begin at 0, too."""
    file = tmp_path_factory.mktemp("weights") / "neurora.npz"
    arrays = NeuRoRA().trainer(0).weights()
    rng = np.random.default_rng(0)
    changed = {name: rng.normal(0, 0.3, a.shape).astype(np.float32) for name, a in arrays.items() if "fine.out" in name}
    write_weights(file, {**arrays, **changed}, {"method": "neurora"})
    return NeuRoRA(weights=str(file))


def test_clean_net_in_numpy_is_the_one_in_torch() -> None:
    torch.manual_seed(0)
    network, graph = CleanNet(), DirectedGraph.of(noisy())
    logits, rectified = clean_net(arrays_of(network), graph)
    with torch.no_grad():
        expected = network(TorchGraph(graph))
    np.testing.assert_allclose(logits, expected[0].numpy(), atol=1e-5)
    np.testing.assert_allclose(rectified, expected[1].numpy(), atol=1e-5)


def test_fine_net_in_numpy_is_the_one_in_torch() -> None:
    torch.manual_seed(0)
    network, graph = FineNet(), DirectedGraph.of(noisy())
    torch.nn.init.normal_(network.out.weight)
    start = so3.to_quaternion(so3.random(np.random.default_rng(1), 12))
    with torch.no_grad():
        expected = network(TorchGraph(graph), torch.from_numpy(start.astype("float32"))).numpy()
    np.testing.assert_allclose(fine_net(arrays_of(network), graph, start), expected, atol=1e-5)
    assert np.abs(expected - start).max() > 0.01


def test_the_networks_have_the_sizes_of_the_originals() -> None:
    never_used = 1472  # of the 23 717 of the public CleanNet
    assert sum(p.numel() for p in CleanNet().parameters()) == 23_717 - never_used
    assert sum(p.numel() for p in FineNet().parameters()) == 20_356


def test_quaternions_multiply_as_rotations() -> None:
    p, q = so3.to_quaternion(so3.random(np.random.default_rng(0), 2))
    found = unit(3 * product(torch.from_numpy(p), torch.from_numpy(q))).numpy()
    np.testing.assert_allclose(so3.from_quaternion(found), so3.from_quaternion(p) @ so3.from_quaternion(q), atol=1e-12)


def test_the_tree_goes_round_outliers_and_counts_edges_otherwise() -> None:
    """On a wheel with hub 0 every camera is one edge away, but for a spoke that is an outlier."""
    spokes, rim = [(0, k) for k in range(1, 7)], [(k, k + 1) for k in range(1, 6)]
    problem, _ = simulated(np.array(spokes + rim, dtype=np.int32))
    inlier = np.full(problem.m, 0.9)
    assert sorted(inlier_tree(problem, inlier).tolist()) == list(range(6))
    inlier[2], inlier[7] = 0.4, 0.95  # the spoke to camera 3, and the edge (2, 3)
    assert sorted(inlier_tree(problem, inlier).tolist()) == [0, 1, 3, 4, 5, 7]


def test_where_all_edges_look_wrong_there_is_a_tree_and_it_is_kept() -> None:
    problem, truth = simulated(grid_edges(4, 5))
    inlier = np.full(problem.m, 0.05)
    tree = inlier_tree(problem, inlier)
    assert len(tree) == problem.n - 1
    np.testing.assert_array_equal(np.flatnonzero(kept_edges(inlier, tree)), np.sort(tree))
    found = propagated(problem, tree)
    np.testing.assert_allclose(found @ np.swapaxes(found[:1], 1, 2), truth @ np.swapaxes(truth[:1], 1, 2), atol=1e-9)


def test_an_edge_is_trusted_as_far_as_both_of_its_directions_are() -> None:
    problem = noisy()
    graph = DirectedGraph.of(problem)
    forward = graph.at < graph.other
    lower = np.minimum(graph.at, graph.other)
    trust = both_ways(graph, np.where(forward, 0.5, 0.25) * (1 + lower))
    np.testing.assert_allclose(trust, 0.125 * (1 + problem.edges[:, 0]) ** 2)


def moved(name: str, problem: Problem) -> tuple[Problem, Callable[[Floats], Floats]]:
    """A problem that is the same but for how it is written, and what maps its answer back."""
    if name == "reversed":
        order = np.arange(problem.n)[::-1]
        return problem.subgraph(order)[0], lambda rotations: rotations[::-1]
    changed, order = transformed(problem)
    return changed, lambda rotations: rotations[np.argsort(order)]


@pytest.mark.parametrize("name", ["permuted", "reversed"])
@pytest.mark.parametrize("seed", range(3))
def test_how_a_graph_is_written_does_not_matter(random_weights: NeuRoRA, name: str, seed: int) -> None:
    problem, rng = noisy(seed), np.random.default_rng(0)
    changed, back = moved(name, problem)
    here, there = (random_weights.solve(p, rng).rotations for p in (problem, changed))
    np.testing.assert_allclose(back(there), here, atol=1e-5)


@pytest.mark.parametrize("edges", [[(0, 1)], [(0, 1), (1, 2), (1, 3)], [(0, 1), (0, 2), (1, 2)]])
def test_measurements_without_error_are_met_whatever_the_weights(
    random_weights: NeuRoRA, edges: list[tuple[int, int]]
) -> None:
    problem, _ = simulated(np.array(edges, dtype=np.int32))
    found = random_weights.solve(problem, np.random.default_rng(0))
    assert found.stop_reason == "edges agree better with the tree of measurements"
    assert problem.residuals(found.rotations).max() < 1e-9


def test_every_pass_of_fine_net_goes_on_from_the_one_before(
    random_weights: NeuRoRA, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, rng = noisy(), np.random.default_rng(0)
    monkeypatch.setattr("bench.methods.neurora.propagated", lambda *_: so3.random(np.random.default_rng(9), problem.n))
    several = [NeuRoRA(weights=random_weights.weights, passes=p).solve(problem, rng) for p in (0, 1, 2)]
    assert [found.iterations for found in several] == [0, 1, 2]
    assert {found.stop_reason for found in several} == {"fixed number of passes"}
    steps = [so3.angle_between(a.rotations, b.rotations) for a, b in pairwise(several)]
    assert np.min(steps) > 1e-4


def test_the_start_follows_what_lies_between_both_directions() -> None:
    """R_ij exp(v) and the transpose of R_ij exp(-v) come to R_ij, whatever the signs of their quaternions."""
    problem, truth = simulated(grid_edges(3, 4))
    graph = DirectedGraph.of(problem)
    turn = so3.exp(np.array([0.0, 0.2, 0.4]))
    forward = (graph.at < graph.other)[:, None, None]
    rectified = so3.to_quaternion(np.where(forward, graph.rotations @ turn, turn @ graph.rotations))
    rectified[::3] *= -1
    start = start_rotations(problem, inlier_tree(problem, np.ones(problem.m)), graph, rectified)
    root = hub(problem)
    np.testing.assert_allclose(start, truth @ truth[root].T, atol=1e-9)


def test_the_loss_falls_and_steps_alone_decide_the_weights() -> None:
    graphs = [learned_from(seed) for seed in range(4)]
    runs = []
    for _ in range(2):
        trainer, rng = NeuRoRA().trainer(3), np.random.default_rng(0)
        losses = [trainer.step([graphs[k % 4], graphs[(k + 1) % 4]], rng) for k in range(40)]
        runs.append(trainer.weights())
    assert np.mean(losses[-4:]) < 0.85 * np.mean(losses[:4])
    assert all(np.array_equal(array, runs[1][name]) for name, array in runs[0].items())


def test_a_graph_whose_start_is_hopeless_teaches_clean_net_alone() -> None:
    graph = learned_from(0)
    haar = so3.random(np.random.default_rng(0), graph.problem.m)
    wrong = Instance(Problem(graph.problem.n, graph.problem.edges, haar), graph.truth, "wrong")
    trainer = NeuRoRA().trainer(0)
    before = trainer.weights()
    trainer.step([wrong], np.random.default_rng(0))
    after = trainer.weights()
    changed = {name for name, array in before.items() if np.any(after[name] != array)}
    assert {name.split(".")[0] for name in changed} == {"clean"}


def test_the_weights_that_are_shipped_tell_outliers_and_beat_their_start() -> None:
    """On graphs from seeds that no training has."""
    rng = np.random.default_rng(0)
    for seed in range(987_654, 987_658):
        (source,) = NeuRoRAGraphs(100, 100).sources(None, seed)
        graph = source.load()
        assert graph.truth is not None
        assert graph.outliers is not None
        found, start = (NeuRoRA(passes=p).solve(graph.problem, rng) for p in (12, 0))
        trust = np.asarray(found.edge_weights)
        right, wrong = trust[~graph.outliers], trust[graph.outliers]
        assert np.mean(right[:, None] > wrong) > 0.9
        medians = [np.median(errors_deg(estimate.rotations, graph.truth)) for estimate in (found, start)]
        assert medians[0] < 0.75 * medians[1]
        assert medians[0] < 2.8
    assert "trained on simulated graphs" in found.notes[0]
