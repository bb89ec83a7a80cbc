"""How the gates are learned: what cameras are like after each pass, and which edges are outliers."""

import numpy as np
import torch
from torch import Tensor, nn

from bench import Floats, Instance

from ...descent.descent import Descent
from ...starts import start_rotations
from ..torch_errors import inliers, left_over, mean_loss
from ..torch_layers import TorchGraph
from ..torch_least_squares import least_squares
from ..torch_trainer import TorchTrainer
from .torch_network import GateNet
from .view import LEAST_WEIGHT, PASSES, View, geman_mcclure

EARLIER, SHARE = 2, 0.25  # passes that are learned from beside the last, and what each counts; the rest lead on
BATCH, RATE, DECAY, CLIP = 2, 2e-3, 1e-4, 1.0
OF_EDGES, OF_GATES = 0.5, 0.1  # weights of the relative errors and of the gates, that of the cameras being 1


def trainer(seed: int) -> TorchTrainer:
    """A network that has learned nothing."""
    torch.manual_seed(seed)
    network = GateNet()
    optimizer = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=DECAY)
    return TorchTrainer(network, Joint(network), optimizer, BATCH, CLIP)


class Joint:
    """The joint loss on a graph: half in the last pass, a quarter each in two others that are drawn at random.

    In each it is the mean over the cameras of f(error of R_i), plus half the mean over the edges of f(error of
    R_i R_j^T), plus a tenth of the cross-entropy of the gates against the inliers; f(e) = log(1 + e / 0.5) + 0.05 e,
    in degrees. The least squares problem of a pass is differentiated; the passes before it are not.
    """

    def __init__(self, network: GateNet) -> None:
        self._network = network
        self._seen: dict[int, tuple[Instance, View, Floats]] = {}

    def __call__(self, instance: Instance, rng: np.random.Generator) -> Tensor:
        """The loss; what is random is which passes count."""
        view, start = self._prepared(instance)
        graph, problem = TorchGraph(view.graph), instance.problem
        descent = Descent(problem, start, 0.0)
        counted = {PASSES - 1: 1 - EARLIER * SHARE}
        counted |= dict.fromkeys(rng.choice(PASSES - 1, EARLIER, replace=False).tolist(), SHARE)
        total = torch.zeros(())
        for k, scale in enumerate(view.scales.tolist()):
            features = torch.from_numpy(view.features(descent, scale))
            kernel = torch.from_numpy(geman_mcclure(descent.angles, scale))
            with torch.set_grad_enabled(k in counted and torch.is_grad_enabled()):
                logits = self._network(graph, features)[torch.from_numpy(view.graph.forward > 0)]
                order = torch.from_numpy(view.graph.edge[view.graph.forward > 0].astype("int64"))
                logits = torch.zeros(problem.m).index_copy(0, order, logits)
                weights = torch.sigmoid(logits).double() * kernel + LEAST_WEIGHT
                if k in counted:
                    total = total + counted[k] * self._loss(instance, descent, logits, weights)
            descent.step(weights.detach().numpy())
        return total

    def _prepared(self, instance: Instance) -> tuple[View, Floats]:
        if id(instance) not in self._seen:
            start = start_rotations("spectral", instance.problem, np.random.default_rng(0))
            self._seen[id(instance)] = instance, View.of(instance.problem), start
        return self._seen[id(instance)][1:]

    def _loss(self, instance: Instance, descent: Descent, logits: Tensor, weights: Tensor) -> Tensor:
        """The loss of one pass; of the descent, which moves on before the derivative is taken, nothing is kept."""
        i, j = torch.from_numpy(instance.problem.edges.astype("int64")).T
        steps = least_squares(instance.problem.n, i, j, weights, torch.from_numpy(descent.vectors.copy()))
        errors = left_over(steps, descent.cameras, instance)
        of_gates = nn.functional.binary_cross_entropy_with_logits(logits, inliers(instance).to(logits))
        return mean_loss(errors) + OF_EDGES * mean_loss(errors[i] - errors[j]) + OF_GATES * of_gates
