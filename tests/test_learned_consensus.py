"""Learned precisions: consensus before training, both forms alike, exact, blind to names; and it learns."""

from pathlib import Path

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated, transformed

from bench import Instance, Problem
from bench.datasets._simulated.correlated import Law
from bench.learning.weights import Arrays, write_weights
from bench.methods._lib.consensus.solution import solution
from bench.methods._lib.learned.gated import gated
from bench.methods._lib.learned.precision.view import View
from bench.methods.consensus import Consensus
from bench.methods.learned_consensus import LearnedConsensus

torch = pytest.importorskip("torch")

RNG = np.random.default_rng(0)  # the method draws nothing from it


def photographs(seed: int, n: int = 40) -> Instance:
    """Errors that are correlated at cameras."""
    rng = np.random.default_rng(seed)
    edges = random_edges(n, 0.4, seed)
    truth, rotations, _ = Law.drawn(rng).simulate(n, edges, rng)
    return Instance(Problem(n, edges, rotations), truth, f"photographs-{seed}")


def with_weights(path: Path, arrays: Arrays) -> LearnedConsensus:
    write_weights(path, arrays, {"method": "learned-consensus", "cpu_seconds": 0})
    return LearnedConsensus(weights=str(path))


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> LearnedConsensus:
    """One that changes much, because all its parameters are random."""
    rng = np.random.default_rng(3)
    new = LearnedConsensus().trainer(3).weights()
    arrays = {name: rng.normal(0, 0.2, array.shape).astype(np.float32) for name, array in new.items()}
    return with_weights(tmp_path_factory.mktemp("learned-consensus") / "random.npz", arrays)


def test_before_training_it_is_consensus(tmp_path: Path) -> None:
    """But for three more steps with the same loss."""
    problem = photographs(0).problem
    untaught = with_weights(tmp_path / "new.npz", LearnedConsensus().trainer(0).weights())
    found = untaught.solve(problem, RNG).rotations
    assert errors_deg(found, Consensus().solve(problem, RNG).rotations).max() < 0.1


def test_both_forms_agree(network: LearnedConsensus) -> None:
    from bench.methods._lib.learned.precision.training import Joint
    from bench.methods._lib.learned.precision.view import OUTPUTS, WIDTH
    from bench.methods._lib.learned.torch_gated import GatedNet
    from bench.methods._lib.learned.torch_layers import TorchGraph

    problem = photographs(1).problem
    found = solution(problem)
    view, descent = View.of(problem, found), found.descent
    arrays, module = network.trained().arrays, GatedNet(WIDTH, OUTPUTS)
    module.load_state_dict({name: torch.from_numpy(array.copy()) for name, array in arrays.items()})
    with torch.no_grad():
        wanted = Joint(module)._answers(TorchGraph(view.graph), view, descent)
    outputs = gated(arrays, view.graph, view.features(descent))
    told = view.answers(descent, outputs.astype(np.float64))
    assert np.ptp(told[0]) > 0.2
    assert np.linalg.norm(told[1], axis=1).max() > np.radians(0.05)
    for ours, theirs in zip(told, wanted, strict=True):
        np.testing.assert_allclose(ours, theirs.numpy(), atol=1e-5)


def test_names_gauge_and_order_do_not_matter(network: LearnedConsensus) -> None:
    problem = photographs(2).problem
    relabelled, order = transformed(problem)
    first, second = network.solve(problem, RNG).rotations, network.solve(relabelled, RNG).rotations
    assert errors_deg(first, Consensus().solve(problem, RNG).rotations).max() > 0.1
    assert errors_deg(second, first[order]).max() < 1e-5 * 180 / np.pi


def test_noise_free_graphs_are_solved_exactly(network: LearnedConsensus) -> None:
    for edges in (random_edges(12, 0.5), np.array([[0, 1]]), np.array([[0, 1], [1, 2], [1, 3], [3, 4]])):
        problem, truth = simulated(edges)
        assert errors_deg(network.solve(problem, RNG).rotations, truth).max() < 1e-6


def test_the_derivative_of_the_loss_is_what_differences_tell() -> None:
    """Also where the cameras have moved on before it is taken, as they do in training."""
    from bench.methods._lib.learned.precision.training import Joint
    from bench.methods._lib.learned.precision.view import OUTPUTS, WIDTH
    from bench.methods._lib.learned.torch_gated import GatedNet

    instance, joint = photographs(3), Joint(GatedNet(WIDTH, OUTPUTS))
    descent, m = solution(instance.problem).descent, instance.problem.m
    rng = np.random.default_rng(0)
    weights, errors = torch.from_numpy(rng.random(m) + 0.1), torch.from_numpy(0.01 * rng.standard_normal((m, 3)))
    way, turn = torch.from_numpy(rng.standard_normal(m)), torch.from_numpy(0.1 * rng.standard_normal((m, 3)))

    def loss(step: torch.Tensor) -> torch.Tensor:
        return joint._loss(instance, descent, weights * torch.exp(step * way), errors + step * turn)

    zero = torch.zeros((), dtype=torch.float64, requires_grad=True)
    wanted = float(((loss(zero + 1e-6) - loss(zero - 1e-6)) / 2e-6).detach())
    found = loss(zero)
    descent.step(np.ones(m))
    found.backward()
    assert float(zero.grad) == pytest.approx(wanted, rel=1e-4)


def test_the_loss_falls() -> None:
    graphs, held_out = [photographs(seed) for seed in range(4)], photographs(9)
    trainer = LearnedConsensus().trainer(0)
    before = trainer.loss(held_out)
    for step in range(40):
        trainer.step([graphs[step % 4], graphs[(step + 1) % 4]], np.random.default_rng(step))
    assert trainer.loss(held_out) < before


def test_the_weights_that_are_shipped_beat_consensus_on_errors_that_are_correlated() -> None:
    graphs = [photographs(seed, 80) for seed in range(20, 30)]
    found = [
        [np.median(errors_deg(method.solve(graph.problem, RNG).rotations, graph.truth)) for graph in graphs]
        for method in (LearnedConsensus(), Consensus())
    ]
    assert np.log(np.divide(*found)).mean() < np.log(0.97)
