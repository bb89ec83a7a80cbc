"""How MSP learns: which edges to follow, and what to do where that leads."""

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from bench import Floats, Instance, so3

from ..directed import DirectedGraph
from ..torch_errors import inliers, mean_loss
from ..torch_layers import TorchGraph
from ..torch_quaternions import inverse, product
from ..torch_trainer import TorchTrainer
from . import network
from .propagation import gradient, propagated
from .refinement import STEEPNESS
from .solution import PASSES, Sources, View, moved, start
from .torch_network import VoteNet, WeightNet

BATCH, RATE, DECAY, CLIP = 2, 1e-3, 1e-4, 1.0
SOURCES, STEPS = 3, 10  # sources and steps of refinement in training
OF_START = 0.5  # weight of the errors of what the sources tell


class Networks(nn.Module):
    """Both networks of MSP."""

    def __init__(self) -> None:
        super().__init__()
        self.weights, self.votes = WeightNet(), VoteNet()


def trainer(seed: int) -> TorchTrainer:
    """Networks that have learned nothing."""
    torch.manual_seed(seed)
    networks = Networks()
    optimizer = torch.optim.AdamW(networks.parameters(), lr=RATE, weight_decay=DECAY)
    return TorchTrainer(networks, Joint(networks), optimizer, BATCH, CLIP)


class Joint:
    """The loss of both networks on a graph.

    Cross-entropy of the weights against the inliers; half the mean over the sources of the mean f of the errors of what
    they tell, differentiated through the propagation; the mean over the passes of the fine network, each from where the
    one before led, the first from what `solve` would start from, of the mean f of the errors of the cameras plus half
    that of the edges. f: see `mean_loss`. Errors are counted after the world is turned to their geodesic median.
    """

    def __init__(self, networks: Networks) -> None:
        self._networks = networks
        self._seen: dict[int, tuple[Instance, Floats, float]] = {}

    def __call__(self, instance: Instance, rng: np.random.Generator) -> Tensor:
        """The loss, which has nothing random in it."""
        assert instance.truth is not None
        view = self._view(instance)
        graph = TorchGraph(view.graph)
        directed = self._networks.weights(graph, torch.from_numpy(view.measured))
        edge = torch.from_numpy(view.graph.edge.astype("int64"))
        logits = directed.new_zeros(instance.problem.m).index_copy(0, edge, directed)
        total = nn.functional.binary_cross_entropy_with_logits(logits, inliers(instance))
        weights = torch.sigmoid(STEEPNESS * logits).double()
        sources = Sources.of(view.graph, weights.detach().numpy(), SOURCES)
        for source in sources.cameras:
            told: Tensor = Propagation.apply(weights, view.graph, source, sources.rounds)  # type: ignore[no-untyped-call]
            errors = _vectors(told, instance.truth)
            total = total + OF_START * mean_loss(errors) / len(sources.cameras)
        cameras, after = start(view.graph, logits.detach().numpy().astype(float), sources, STEPS)
        return total + self._fine_loss(view, graph, cameras, after, instance)

    def _fine_loss(self, view: View, graph: TorchGraph, cameras: Floats, logits: Floats, instance: Instance) -> Tensor:
        assert instance.truth is not None
        i, j = torch.from_numpy(instance.problem.edges.astype("int64")).T
        measured = torch.from_numpy(instance.truth)
        between = measured[i] @ measured[j].mT
        total = torch.zeros(())
        for _ in range(PASSES):
            asked = network.asked_of(view.graph, cameras)
            features = torch.from_numpy(view.seen(logits, asked))
            steps = self._networks.votes(graph, features, torch.from_numpy(asked.astype("float32")))
            rotations = so3.from_quaternion(cameras)
            gauge = so3.geodesic_median(np.swapaxes(rotations, 1, 2) @ instance.truth)
            wanted = so3.log(instance.truth @ np.swapaxes(rotations @ gauge, 1, 2))
            errors = steps - torch.from_numpy(wanted)
            relative = errors[i] - (between @ errors[j][:, :, None])[:, :, 0]
            total = total + (mean_loss(errors) + 0.5 * mean_loss(relative)) / PASSES
            cameras = moved(cameras, steps.detach().numpy().astype(float))
        return total

    def _view(self, instance: Instance) -> View:
        if id(instance) not in self._seen:
            view = View.of(instance.problem)
            self._seen[id(instance)] = instance, view.triangles, view.noise
        _, triangles, noise = self._seen[id(instance)]
        return View(DirectedGraph.of(instance.problem), triangles, noise)


class Propagation(torch.autograd.Function):
    """What a source tells (n, 4), of weights (m,): see `propagation`, whose derivative it takes."""

    @staticmethod
    def forward(ctx: Any, weights: Tensor, graph: DirectedGraph, source: int, rounds: int) -> Tensor:
        ctx.values = weights.detach().numpy(), graph
        ctx.wave = propagated(graph, ctx.values[0], source, rounds)
        return torch.from_numpy(ctx.wave.last)

    @staticmethod
    def backward(ctx: Any, of_cameras: Tensor) -> tuple[Tensor, None, None, None]:
        weights, graph = ctx.values
        return torch.from_numpy(gradient(graph, weights, ctx.wave, of_cameras.numpy())), None, None, None


def _vectors(cameras: Tensor, truth: Floats) -> Tensor:
    """(n, 3) rotation vectors, to first order, from the truth (n, 3, 3) to cameras (n, 4), seen in the world.

    The world is turned to their geodesic median, and their median in each coordinate is subtracted: that is
    differentiated, so that the rotation of the source, to which all cameras hold, is no error of theirs.
    """
    rotations = so3.from_quaternion(cameras.detach().numpy())
    gauge = so3.geodesic_median(np.swapaxes(rotations, 1, 2) @ truth)
    true = torch.from_numpy(so3.to_quaternion(truth @ gauge.T))
    between = product(inverse(true), cameras)
    vectors = 2 * between[:, 1:] * torch.sign(between[:, :1].detach())
    return vectors - vectors.median(dim=0).values
