"""Gated messages over directed edges, in torch, for training; `gated` computes the same in numpy."""

import torch
from torch import Tensor, nn

from .torch_layers import TorchGraph

HIDDEN, LAYERS = 32, 2
EMPTY = 1e-3  # keeps the mean of a camera finite whose gates are all closed


class GatedLayer(nn.Module):
    """Messages of directed edges, their gated means at the cameras, and what edges make of both.

    g_e = sigmoid(gate h_e), x_i = sum_e g_e h_e / sum_e g_e over the edges of camera i, and
    h_e <- h_e + out silu(own h_e + back h_reverse(e) + camera x_i + other x_j).
    """

    def __init__(self) -> None:
        super().__init__()
        self.gate, self.own = nn.Linear(HIDDEN, 1), nn.Linear(HIDDEN, HIDDEN)
        self.back = nn.Linear(HIDDEN, HIDDEN, bias=False)
        self.camera = nn.Linear(HIDDEN, HIDDEN, bias=False)
        self.other = nn.Linear(HIDDEN, HIDDEN, bias=False)
        self.out = nn.Linear(HIDDEN, HIDDEN)

    def forward(self, graph: TorchGraph, edges: Tensor) -> Tensor:
        """Edge features (2m, h), of edge features (2m, h)."""
        gates = torch.sigmoid(self.gate(edges))
        cameras = graph.sums(gates * edges) / (graph.sums(gates) + EMPTY)
        hidden = self.own(edges) + self.back(edges)[graph.reverse]
        hidden = hidden + self.camera(cameras)[graph.at] + self.other(cameras)[graph.other]
        return edges + self.out(nn.functional.silu(hidden))


class GatedNet(nn.Module):
    """Numbers for every directed edge, of features of all of them; zero before it is trained.

    Parameters
    ----------
    features, outputs
        How many an edge has, and is told.
    """

    def __init__(self, features: int, outputs: int) -> None:
        super().__init__()
        self.embed = nn.Linear(features, HIDDEN)
        self.layers = nn.ModuleList(GatedLayer() for _ in range(LAYERS))
        self.head = nn.Linear(HIDDEN, outputs)
        nn.init.zeros_(self.head.weight)
        nn.init.zeros_(self.head.bias)

    def forward(self, graph: TorchGraph, features: Tensor) -> Tensor:
        """(2m, outputs), of features (2m, k)."""
        edges = nn.functional.silu(self.embed(features))
        for layer in self.layers:
            edges = layer(graph, edges)
        return torch.as_tensor(self.head(edges))
