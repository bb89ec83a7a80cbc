"""What RAGO learns from, and how."""

from weakref import WeakKeyDictionary

import numpy as np
import torch
from torch import Tensor

from bench import Floats, Instance, so3

from ...graph.all_triangles import AllTriangles
from ...graph.hierarchical_tree import supported_tree
from ...graph.restricted import restricted
from ...graph.trees import tree_edges
from ..directed import DirectedGraph
from ..torch_layers import TorchGraph
from ..torch_trainer import TorchTrainer
from .network import SUPPORT
from .torch_network import Rago, difference, relative

OUTER, CAMERA_UPDATES = 3, 3
KEPT, MOST_EDGES = 0.8, 2500  # of the edges of a graph, in each step
FADING = 0.8  # of the loss of an update to that of the one before
PRECISE = 0.01  # radians below which errors count as they are, and above which their logarithm
LEARNING_RATE, CLIP = 2e-3, 1.0


def trainer(seed: int) -> TorchTrainer:
    """A network that has learned nothing yet."""
    torch.manual_seed(seed)
    network = Rago()
    starts: WeakKeyDictionary[Instance, Floats] = WeakKeyDictionary()

    def loss(graph: Instance, rng: np.random.Generator) -> Tensor:
        if graph not in starts:
            starts[graph] = supported_tree(graph.problem, AllTriangles.of(graph.problem), SUPPORT).rotations
        return loss_of(network, thinned(graph, rng), starts[graph])

    return TorchTrainer(network, loss, torch.optim.AdamW(network.parameters(), LEARNING_RATE), clip=CLIP)


def thinned(graph: Instance, rng: np.random.Generator) -> tuple[TorchGraph, Floats]:
    """Some of the edges, by chance, with a tree that keeps the graph connected; and the truth (n, 3, 3)."""
    problem = graph.problem
    kept = np.zeros(problem.m, dtype=np.bool_)
    kept[rng.choice(problem.m, min(int(KEPT * problem.m), MOST_EDGES), replace=False)] = True
    kept[tree_edges(problem, rng.random(problem.m))] = True
    assert graph.truth is not None
    return TorchGraph(DirectedGraph.of(restricted(problem, kept))), graph.truth


def loss_of(network: Rago, known: tuple[TorchGraph, Floats], start: Floats) -> Tensor:
    """Sum over the updates of cameras and of edges, later ones weighted more, of errors of relative rotations.

    The error of an update is the mean over directed edges of log(1 + |v|_1 / `PRECISE`), v being the difference, as a
    vector, of R_i R_j^T or of the rectified edge from the true relative rotation.
    """
    graph, truth = known
    target = relative(graph, _quaternions(truth))
    moved, rectified = network(graph, _quaternions(start), OUTER, CAMERA_UPDATES)
    total = torch.zeros(())
    for back, cameras in enumerate(reversed(moved)):
        total = total + FADING**back * _error(relative(graph, cameras), target)
    for back, edges in enumerate(reversed(rectified)):
        total = total + FADING ** (CAMERA_UPDATES * back) * _error(edges, target)
    return total


def _error(rotations: Tensor, target: Tensor) -> Tensor:
    return torch.log1p(difference(rotations, target).abs().sum(1) / PRECISE).mean()


def _quaternions(rotations: Floats) -> Tensor:
    return torch.from_numpy(so3.to_quaternion(rotations)).float()
