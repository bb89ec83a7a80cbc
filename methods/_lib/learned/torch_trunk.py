"""The four layers that CleanNet and FineNet are made of, in torch; `trunk` computes the same in numpy."""

import torch
from torch import Tensor, nn

from .torch_layers import EdgeConv, TorchGraph

HIDDEN = 32


class Trunk(nn.Module):
    """Four EdgeConv layers (NeuRoRA: Purkait, Chin and Reid, ECCV 2020), a relu after each on cameras and on edges.

    The second layer sees the edge features of the input again; the third and the fourth see the features of the last
    two layers, of cameras and of edges.

    Parameters
    ----------
    camera, edge
        Widths of the camera features (0: there are none) and of the edge features that it is given.
    hidden
        Width of every layer.
    """

    def __init__(self, camera: int, edge: int, hidden: int = HIDDEN) -> None:
        super().__init__()
        self.first = EdgeConv(camera, edge, hidden)
        self.second = EdgeConv(hidden, edge + hidden, hidden)
        self.third = EdgeConv(2 * hidden, 2 * hidden, hidden)
        self.fourth = EdgeConv(2 * hidden, 2 * hidden, hidden)

    def forward(self, graph: TorchGraph, cameras: Tensor | None, edges: Tensor) -> tuple[Tensor, Tensor]:
        """Features of cameras (n, h) and of directed edges (2m, h), both after the last activation."""
        x1, e1 = _relu(self.first(graph, cameras, edges))
        x2, e2 = _relu(self.second(graph, x1, torch.hstack([edges, e1])))
        x3, e3 = _relu(self.third(graph, torch.hstack([x2, x1]), torch.hstack([e2, e1])))
        return _relu(self.fourth(graph, torch.hstack([x3, x2]), torch.hstack([e3, e2])))


def _relu(features: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
    cameras, edges = features
    return torch.relu(cameras), torch.relu(edges)
