"""The reconstruction of PoGO-Net: its two forms agree, no frame of the world matters, and it learns."""

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated, transformed

from bench import Instance, Problem, so3
from bench.datasets._simulated.correlated import Law
from bench.learning.weights import write_weights
from bench.methods._lib.descent.descent import Descent
from bench.methods._lib.learned.pogo_net.network import gates
from bench.methods._lib.learned.pogo_net.view import View
from bench.methods._lib.starts import start_rotations
from bench.methods.pogo_net import PoGONet
from bench.methods.spectral import Spectral

torch = pytest.importorskip("torch")


def noisy(seed: int, n: int = 20) -> Instance:
    problem, truth = simulated(random_edges(n, 0.4, seed), noise_deg=3, outliers=0.2, seed=seed)
    return Instance(problem, truth, f"noisy-{seed}")


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> PoGONet:
    """One whose gates are far from one half, because all its parameters are random."""
    trainer = PoGONet().trainer(3)
    rng = np.random.default_rng(3)
    arrays = {name: rng.normal(0, 0.2, a.shape).astype(np.float32) for name, a in trainer.weights().items()}
    path = tmp_path_factory.mktemp("pogo") / "random.npz"
    write_weights(path, arrays, {"method": "pogo-net", "cpu_seconds": 0})
    return PoGONet(weights=str(path))


def test_both_forms_agree(network: PoGONet) -> None:
    from bench.methods._lib.learned.pogo_net.torch_network import GateNet
    from bench.methods._lib.learned.torch_layers import TorchGraph

    instance = noisy(0)
    view = View.of(instance.problem)
    features = view.features(Descent(instance.problem, so3.random(np.random.default_rng(0), 20), 0.0), view.scales[3])
    arrays = network.trained().arrays
    module = GateNet()
    module.load_state_dict({name: torch.from_numpy(array.copy()) for name, array in arrays.items()})
    with torch.no_grad():
        directed = torch.sigmoid(module(TorchGraph(view.graph), torch.from_numpy(features))).numpy()
    found = gates(arrays, view.graph, features)
    assert np.ptp(found) > 0.2
    np.testing.assert_allclose(found[view.graph.edge], directed, atol=1e-5)


def test_one_pass_of_training_moves_cameras_as_solve_does(network: PoGONet) -> None:
    from bench.methods._lib.learned.torch_least_squares import least_squares

    problem = noisy(1).problem
    descent = Descent(problem, so3.random(np.random.default_rng(1), problem.n), 0.0)
    weights = np.random.default_rng(2).random(problem.m) + 0.1
    i, j = torch.from_numpy(problem.edges.astype("int64")).T
    steps = least_squares(problem.n, i, j, torch.from_numpy(weights), torch.from_numpy(descent.vectors)).numpy()
    before = so3.from_quaternion(descent.cameras)
    descent.step(weights)
    np.testing.assert_allclose(so3.from_quaternion(descent.cameras), before @ so3.exp(steps), atol=1e-9)


def test_names_of_cameras_and_order_of_edges_do_not_matter(network: PoGONet) -> None:
    problem = noisy(2).problem
    relabelled, order = transformed(problem)
    rng = np.random.default_rng(0)
    first, second = network.solve(problem, rng).rotations, network.solve(relabelled, rng).rotations
    assert errors_deg(second, first[order]).max() < 1e-5 * 180 / np.pi


def test_noise_free_graphs_are_solved_exactly(network: PoGONet) -> None:
    for edges in (random_edges(12, 0.5), np.array([[0, 1]]), np.array([[0, 1], [1, 2], [1, 3], [3, 4]])):
        problem, truth = simulated(edges)
        estimate = network.solve(problem, np.random.default_rng(0))
        assert errors_deg(estimate.rotations, truth).max() < 1e-5


def test_it_says_what_it_is(network: PoGONet) -> None:
    problem: Problem = noisy(3).problem
    notes = " ".join(network.solve(problem, np.random.default_rng(0)).notes)
    assert "reconstructed" in notes
    assert "trained on simulated graphs" in notes


def test_the_derivative_of_the_loss_is_what_differences_tell() -> None:
    """Also where the cameras have moved on before it is taken, as they do in training."""
    from bench.methods._lib.learned.pogo_net.torch_network import GateNet
    from bench.methods._lib.learned.pogo_net.training import Joint

    instance, joint, rng = noisy(5), Joint(GateNet()), np.random.default_rng(0)
    logits, way = torch.from_numpy(rng.standard_normal((2, instance.problem.m)))
    logits.requires_grad_()
    start = start_rotations("spectral", instance.problem, rng)

    def loss(step: float):
        return joint._loss(instance, descent, logits + step * way, torch.sigmoid(logits + step * way))

    descent = Descent(instance.problem, start, 0.0)
    wanted = float(((loss(1e-6) - loss(-1e-6)) / 2e-6).detach())
    found = loss(0)
    descent.step(np.ones(instance.problem.m))
    found.backward()
    assert float((logits.grad * way).sum()) == pytest.approx(wanted, rel=1e-5)


def test_the_loss_falls() -> None:
    graphs, held_out = [noisy(seed) for seed in range(4)], noisy(9)
    trainer = PoGONet().trainer(0)
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
    found = [errors_deg(method.solve(problem, rng).rotations, truth) for method in (PoGONet(), Spectral())]
    assert np.median(found[0]) < 0.7 * np.median(found[1])
    assert "CPU-" in " ".join(PoGONet().solve(problem, rng).notes)
