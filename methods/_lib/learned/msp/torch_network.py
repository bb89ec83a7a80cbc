"""The two networks of MSP in torch, for training; `network` computes the same in numpy."""

import torch
from torch import Tensor, nn

from ..torch_layers import TorchGraph
from ..torch_trunk import HIDDEN, Trunk
from ..triangles import FEATURES

MEASURED, SEEN = 4 + FEATURES, 5 + FEATURES  # widths of what the two networks see of a directed edge
LARGEST = 10.0  # logarithm of a vote


class WeightNet(nn.Module):
    """One logit for each directed edge, from the measurements and what the triangles say."""

    def __init__(self) -> None:
        super().__init__()
        self.trunk, self.inlier, self.inlier_out = Trunk(0, MEASURED), nn.Linear(HIDDEN, HIDDEN), nn.Linear(HIDDEN, 1)

    def forward(self, graph: TorchGraph, edges: Tensor) -> Tensor:
        """Logits (2m,), the same for both directions of an edge, of features (2m, MEASURED)."""
        logits = self.inlier_out(torch.relu(self.inlier(self.trunk(graph, None, edges)[1])))[:, 0]
        return torch.as_tensor((logits + logits[graph.reverse]) / 2)


class VoteNet(nn.Module):
    """How much each directed edge has to say about where its camera belongs; the same for all before it is trained."""

    def __init__(self) -> None:
        super().__init__()
        self.trunk, self.vote = Trunk(0, SEEN), nn.Linear(HIDDEN, 1)
        nn.init.zeros_(self.vote.weight)
        nn.init.zeros_(self.vote.bias)

    def forward(self, graph: TorchGraph, edges: Tensor, asked: Tensor) -> Tensor:
        """Steps (n, 3) of the cameras: means of what is `asked` (2m, 3), with votes made of features (2m, SEEN)."""
        logits = self.vote(self.trunk(graph, None, edges)[1])
        votes = torch.exp(LARGEST * torch.tanh(logits / LARGEST))
        return graph.sums(votes * asked) / graph.sums(votes)
