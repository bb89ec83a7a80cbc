"""How precisions are learned: by where the cameras stand after each pass."""

import numpy as np
import torch
from torch import Tensor

from bench import Instance, so3

from ...consensus.solution import Solution, solution
from ...descent.descent import Descent
from ...descent.iterate import SMALLEST_WEIGHT, floored
from ..torch_errors import left_over, mean_loss
from ..torch_gated import GatedNet
from ..torch_layers import TorchGraph
from ..torch_least_squares import least_squares
from ..torch_trainer import TorchTrainer
from .view import OUTPUTS, PASSES, STRONGEST, WIDTH, View

BATCH, RATE, DECAY, CLIP = 2, 2e-3, 1e-4, 1.0
OF_EDGES = 0.5  # weight of the relative errors, that of the cameras being 1


def trainer(seed: int) -> TorchTrainer:
    """A network that changes nothing yet."""
    torch.manual_seed(seed)
    network = GatedNet(WIDTH, OUTPUTS)
    optimizer = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=DECAY)
    return TorchTrainer(network, Joint(network), optimizer, BATCH, CLIP)


class Joint:
    """The loss on a graph: half of that after the last pass, a quarter each of those after the others.

    In each it is the mean over the cameras of f(error of R_i), plus half the mean over the edges of f(error of
    R_i R_j^T), f being that of `mean_loss`. The least squares problem of a pass is differentiated; the residuals that
    the network is told in the next one are not.
    """

    def __init__(self, network: GatedNet) -> None:
        self._network = network
        self._seen: dict[int, tuple[Instance, Solution, View]] = {}

    def __call__(self, instance: Instance, rng: np.random.Generator) -> Tensor:
        """The loss, which has nothing random in it."""
        found, view = self._prepared(instance)
        graph = TorchGraph(view.graph)
        descent = Descent(instance.problem, so3.from_quaternion(found.fit.cameras), 0.0)
        total = torch.zeros(())
        for share in PASSES:
            factors, errors = self._answers(graph, view, descent)
            weights = torch.from_numpy(found.weights(descent.angles)) * factors
            total = total + share * self._loss(instance, descent, weights, errors)
            descent.step(floored(weights.detach().numpy()), errors=errors.detach().numpy())
        return total

    def _prepared(self, instance: Instance) -> tuple[Solution, View]:
        if id(instance) not in self._seen:
            found = solution(instance.problem)
            self._seen[id(instance)] = instance, found, View.of(instance.problem, found)
        return self._seen[id(instance)][1:]

    def _answers(self, graph: TorchGraph, view: View, descent: Descent) -> tuple[Tensor, Tensor]:
        """What `View.answers` gives."""
        outputs = self._network(graph, torch.from_numpy(view.features(descent))).double()
        edge, m = torch.from_numpy(view.graph.edge.astype("int64")), len(view.scales)
        logarithms = outputs.new_zeros(m).index_add(0, edge, outputs[:, 0])
        vectors = torch.einsum("eba,eb->ea", torch.from_numpy(view.frames(descent)), outputs[:, 1:])
        errors = outputs.new_zeros((m, 3)).index_add(0, edge, vectors)
        factors = torch.exp(STRONGEST * torch.tanh(logarithms / STRONGEST))
        return factors, torch.from_numpy(view.reach(descent))[:, None] * errors

    def _loss(self, instance: Instance, descent: Descent, weights: Tensor, errors: Tensor) -> Tensor:
        """The loss of one pass; of the descent, which moves on before the derivative is taken, nothing is kept."""
        i, j = torch.from_numpy(instance.problem.edges.astype("int64")).T
        weights = weights / weights.detach().max() + SMALLEST_WEIGHT
        steps = least_squares(instance.problem.n, i, j, weights, torch.from_numpy(descent.vectors.copy()) - errors)
        left = left_over(steps, descent.cameras, instance)
        return mean_loss(left) + OF_EDGES * mean_loss(left[i] - left[j])
