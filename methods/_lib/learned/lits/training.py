"""What LITS learns from, and how."""

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from torch import Tensor, nn

from bench import Floats, Instance, Problem, so3

from ...graph.restricted import restricted
from ...graph.trees import tree_edges
from ..directed import DirectedGraph
from ..torch_layers import TorchGraph
from ..torch_trainer import TorchTrainer
from .torch_network import Lits

RIGHT_DEG, WRONG_DEG = 5.0, 15.0  # trust is learned of edges up to the one and from the other
DECAY = 0.5  # of the loss from an iteration to the one before
PAIRS = 0.2  # weight of the loss of the rotations beside that of trust
MOST_EDGES = 800
TURNED = 1 / 8  # share of the steps on cameras that are not upright
LEARNING_RATE = 2e-3
CLIP = 0.05


def trainer(seed: int) -> TorchTrainer:
    """A network that has learned nothing yet."""
    torch.manual_seed(seed)
    network = Lits()

    def loss(graph: Instance, rng: np.random.Generator) -> Tensor:
        assert graph.truth is not None
        problem, truth = thinned(graph.problem, MOST_EDGES, rng), graph.truth
        if rng.random() < TURNED:
            problem, truth = turned(problem, truth, rng)
        return loss_of(network, problem, truth)

    return TorchTrainer(network, loss, torch.optim.Adam(network.parameters(), LEARNING_RATE), clip=CLIP)


def thinned(problem: Problem, most: int, rng: np.random.Generator) -> Problem:
    """The problem with a tree of edges and others, by chance: at most so many, unless the tree has more."""
    if problem.m <= most:
        return problem
    chance = rng.random(problem.m)
    kept = np.zeros(problem.m, dtype=np.bool_)
    kept[tree_edges(problem, 1 + chance)] = True
    chance[kept] = 2
    kept[np.argsort(-chance)[:most]] = True
    return restricted(problem, kept)


def turned(problem: Problem, truth: Floats, rng: np.random.Generator) -> tuple[Problem, Floats]:
    """The frame of every camera turned by itself, about any axis and by up to an angle that is drawn first."""
    largest = rng.uniform(0, np.pi)
    turns = so3.exp(so3.random_axes(rng, problem.n) * rng.uniform(0, largest, (problem.n, 1)))
    i, j = problem.edges.T
    return replace(problem, rotations=turns[i] @ problem.rotations @ np.swapaxes(turns[j], 1, 2)), turns @ truth


def loss_of(network: Lits, problem: Problem, truth: Floats) -> Tensor:
    """Sum over the iterations, later ones weighted more, of what is wrong with relative rotations and with trust.

    Rotations: mean over the pairs of cameras that edges below `WRONG_DEG` connect of |R_i R_j^T - R*_i R*_j^T|_1, the
    sum over nine entries. Trust: mean cross entropy with an edge being right.
    """
    i, j = problem.edges.T
    wrong_deg = np.degrees(so3.angle_between(problem.rotations, truth[i] @ np.swapaxes(truth[j], 1, 2)))
    directed = DirectedGraph.of(problem)
    error = torch.from_numpy(wrong_deg[directed.edge])
    right, known = (error < RIGHT_DEG).float(), ((error < RIGHT_DEG) | (error > WRONG_DEG)).float()
    pairs = torch.from_numpy(_connected(problem, wrong_deg < WRONG_DEG)).float()
    pairs = (pairs / pairs.sum())[:, None, :, None]
    goal = _relative(torch.from_numpy(truth).float())
    total = torch.zeros(())
    for back, (rotations, logits) in enumerate(reversed(network(TorchGraph(directed)))):
        off = (_relative(rotations) - goal).abs()
        trust = nn.functional.binary_cross_entropy_with_logits(logits, right, known)
        total = total + DECAY**back * (PAIRS * (off * pairs).sum() + trust)
    return total


def _relative(rotations: Tensor) -> Tensor:
    """(n, 3, n, 3) the entries of every R_i R_j^T."""
    n, flat = len(rotations), rotations.reshape(-1, 3)
    return (flat @ flat.T).reshape(n, 3, n, 3)


def _connected(problem: Problem, kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(n, n) which cameras some of the edges connect."""
    i, j = problem.edges[kept].T
    _, label = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(problem.n, problem.n)), directed=False)
    return np.asarray(label[:, None] == label)
