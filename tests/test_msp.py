"""MSP: the derivative by hand is that of torch, both forms of its networks agree, and it learns."""

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated, transformed

from bench import Instance, Problem
from bench.datasets._simulated.correlated import Law
from bench.learning.weights import write_weights
from bench.methods._lib.learned.directed import DirectedGraph
from bench.methods._lib.learned.msp import network
from bench.methods._lib.learned.msp.propagation import gradient, propagated
from bench.methods._lib.learned.msp.refinement import BEND, edge_loss, refined
from bench.methods._lib.learned.msp.solution import Sources, View
from bench.methods.msp import MSP
from bench.methods.spanning_tree import SpanningTree

torch = pytest.importorskip("torch")
ROUNDS, SOURCE = 8, 3


def noisy(seed: int, n: int = 20) -> Instance:
    problem, truth = simulated(random_edges(n, 0.3, seed), noise_deg=3, outliers=0.2, seed=seed)
    return Instance(problem, truth, f"noisy-{seed}")


def index(array):
    return torch.from_numpy(np.asarray(array).astype("int64"))


def in_torch(graph: DirectedGraph, weights):
    """Propagation from a source as `propagation` describes it, in plain operations of torch."""
    from bench.methods._lib.learned.torch_quaternions import product

    cameras = torch.arange(graph.n)
    at, other = torch.cat([cameras, index(graph.at)]), torch.cat([cameras, index(graph.other)])
    one = torch.tensor([[1.0, 0, 0, 0]], dtype=torch.float64).expand(graph.n, 4)
    measured = torch.cat([one, torch.from_numpy(graph.quaternions)])
    weight = torch.cat([torch.ones(graph.n, dtype=torch.float64), weights[index(graph.edge)]])
    q, level = torch.zeros(graph.n, 4, dtype=torch.float64), torch.zeros(graph.n, dtype=torch.float64)
    q[SOURCE, 0] = level[SOURCE] = 1
    for _ in range(ROUNDS):
        value = torch.where(level[other] > 0, weight.detach() * level[other], -1)
        top = torch.zeros(graph.n, dtype=torch.float64).scatter_reduce(0, at, level[other], "amax")
        terms = product(measured, q[other])
        leading = torch.stack([torch.where(at == i, value, -2).argmax() for i in range(graph.n)])
        leading = torch.where(level > 0, cameras, leading)
        sign = torch.where((terms * terms[leading][at]).sum(1) < 0, -1.0, 1.0).detach()
        share = torch.exp(8 * weight * level[other] / top[at].clamp_min(1e-9)) * (level[other] > 0) * sign
        total = torch.zeros_like(q).index_add(0, at, share[:, None] * terms)
        q = torch.where(top[:, None] > 0, total / total.norm(dim=1, keepdim=True).clamp_min(1e-12), 0)
        level = torch.zeros(graph.n, dtype=torch.float64).scatter_reduce(0, at, value.clamp_min(0), "amax")
    return q


def test_propagation_and_its_derivative_are_those_of_torch() -> None:
    graph, rng = DirectedGraph.of(noisy(1, 30).problem), np.random.default_rng(0)
    weights, slope = rng.uniform(0.05, 1, len(graph.edge) // 2), rng.standard_normal((graph.n, 4))
    wave = propagated(graph, weights, SOURCE, ROUNDS)
    variable = torch.tensor(weights, requires_grad=True)
    told = in_torch(graph, variable)
    (told * torch.from_numpy(slope)).sum().backward()
    np.testing.assert_allclose(wave.last, told.detach().numpy(), atol=1e-12)
    np.testing.assert_allclose(gradient(graph, weights, wave, slope), variable.grad.numpy(), atol=1e-12)


def test_the_loss_without_truth_and_its_derivative_are_those_of_torch() -> None:
    from bench.methods._lib.learned.torch_quaternions import inverse, product

    graph, rng = DirectedGraph.of(noisy(2).problem), np.random.default_rng(0)
    confidence = rng.uniform(0.05, 1, len(graph.edge) // 2)
    wave = propagated(graph, confidence, SOURCE, ROUNDS)
    cameras = torch.tensor(wave.last, requires_grad=True)
    measured = torch.from_numpy(graph.quaternions)
    residuals = product(product(measured, cameras[index(graph.other)]), inverse(cameras[index(graph.at)]))
    sizes = 1 - residuals[:, 0].abs() + residuals[:, 1:].abs().sum(1)
    weighted = torch.from_numpy(confidence[graph.edge]) * sizes
    expected = torch.nn.functional.smooth_l1_loss(weighted, torch.zeros_like(weighted), beta=BEND)
    expected.backward()
    loss, of_cameras = edge_loss(graph, confidence, wave)
    assert loss == pytest.approx(float(expected.detach()), abs=1e-12)
    np.testing.assert_allclose(of_cameras, cameras.grad.numpy(), atol=1e-12)


def test_refinement_tells_outliers_without_truth() -> None:
    from bench.methods._lib.learned.torch_errors import inliers

    instance = noisy(3)
    graph = DirectedGraph.of(instance.problem)
    logits, losses = refined(graph, np.full(instance.problem.m, 2.0), (0, 5), ROUNDS, 20)
    assert sum(losses) < 0.5 * sum(refined(graph, np.full(instance.problem.m, 2.0), (0, 5), ROUNDS, 0)[1])
    right = inliers(instance).numpy() > 0
    assert np.median(logits[~right]) < np.median(logits[right]) - 1


def test_the_networks_in_numpy_are_those_in_torch() -> None:
    from bench.methods._lib.learned.msp.training import Networks
    from bench.methods._lib.learned.torch_layers import TorchGraph

    torch.manual_seed(0)
    networks, view = Networks(), View.of(noisy(4).problem)
    torch.nn.init.normal_(networks.votes.vote.weight)
    graph, logits = TorchGraph(view.graph), np.linspace(-3, 3, len(view.triangles))
    asked = network.asked_of(view.graph, propagated(view.graph, np.ones(len(logits)), SOURCE, ROUNDS).last)
    with torch.no_grad():
        weights = networks.weights(graph, torch.from_numpy(view.measured)).numpy()
        seen = torch.from_numpy(view.seen(logits, asked))
        steps = networks.votes(graph, seen, torch.from_numpy(asked.astype("float32"))).numpy()
    arrays = {name: p.detach().numpy() for name, p in networks.named_parameters()}
    found = network.edge_logits(network.within(arrays, "weights"), view.graph, view.measured)
    np.testing.assert_allclose(found[view.graph.edge], weights, atol=1e-5)
    found = network.camera_steps(network.within(arrays, "votes"), view.graph, view.seen(logits, asked), asked)
    np.testing.assert_allclose(found, steps, atol=1e-5)


def test_sources_are_fewer_on_large_graphs_and_reach_every_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    from bench.methods._lib.learned.msp import solution

    chain, _ = simulated(np.stack([np.arange(30), np.arange(1, 31)], axis=1))
    graph = DirectedGraph.of(chain)
    few, weights = Sources.of(graph, np.ones(30), 3), np.ones(30)
    assert (propagated(graph, weights, few.cameras[0], few.rounds).levels[-1] > 0).all()
    monkeypatch.setattr(solution, "VISITS", 1)
    assert len(Sources.of(graph, weights).cameras) == solution.FEWEST


@pytest.fixture(scope="module")
def untaught(tmp_path_factory: pytest.TempPathFactory) -> MSP:
    """With the weights that training begins with."""
    path = tmp_path_factory.mktemp("msp") / "first.npz"
    write_weights(path, MSP().trainer(3).weights(), {"method": "msp", "cpu_seconds": 0})
    return MSP(weights=str(path))


def test_names_of_cameras_and_order_of_edges_do_not_matter(untaught: MSP) -> None:
    problem = noisy(5).problem
    relabelled, order = transformed(problem)
    rng = np.random.default_rng(0)
    first, second = untaught.solve(problem, rng).rotations, untaught.solve(relabelled, rng).rotations
    assert errors_deg(second, first[order]).max() < 1e-5 * 180 / np.pi


def test_noise_free_graphs_are_solved_exactly(untaught: MSP) -> None:
    for edges in (random_edges(12, 0.5), np.array([[0, 1]]), np.array([[0, 1], [1, 2], [1, 3], [3, 4]])):
        problem, truth = simulated(edges)
        assert errors_deg(untaught.solve(problem, np.random.default_rng(0)).rotations, truth).max() < 1e-5


def test_a_graph_too_long_for_its_memory_is_not_refined(untaught: MSP, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.methods._lib.learned.msp.solution.ROUNDS_KEPT", 1)
    estimate = untaught.solve(noisy(6).problem, np.random.default_rng(0))
    assert estimate.iterations == 0
    assert any("not refined" in note for note in estimate.notes)


def test_the_loss_falls() -> None:
    graphs, held_out = [noisy(seed) for seed in range(4)], noisy(9)
    trainer = MSP().trainer(0)
    before = trainer.loss(held_out)
    for step in range(30):
        rng = np.random.default_rng(step)
        trainer.step([graphs[k] for k in rng.choice(4, 2, replace=False)], rng)
    assert trainer.loss(held_out) < before


def test_the_weights_that_are_shipped_beat_the_start_on_errors_as_they_are() -> None:
    rng = np.random.default_rng(4)
    edges = random_edges(60, 0.3, 4)
    truth, rotations, _ = Law.drawn(rng).simulate(60, edges, rng)
    problem = Problem(60, edges, rotations)
    found = [errors_deg(method.solve(problem, rng).rotations, truth) for method in (MSP(), SpanningTree())]
    assert np.median(found[0]) < 0.7 * np.median(found[1])
    assert "CPU-" in " ".join(MSP().solve(problem, rng).notes)
