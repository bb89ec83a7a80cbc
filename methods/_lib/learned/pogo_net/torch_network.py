"""The gates of edges, in torch, for training; `network` computes the same in numpy."""

import torch
from torch import Tensor

from ..torch_gated import GatedNet
from ..torch_layers import TorchGraph
from .view import WIDTH


class GateNet(GatedNet):
    """One gate in (0, 1) for each edge; one half everywhere before it is trained."""

    def __init__(self) -> None:
        super().__init__(WIDTH, outputs=1)

    def forward(self, graph: TorchGraph, features: Tensor) -> Tensor:
        """Logits (2m,) of the gates, the same for both directions of an edge."""
        logits = super().forward(graph, features)[:, 0]
        return torch.as_tensor(logits + logits[graph.reverse])
