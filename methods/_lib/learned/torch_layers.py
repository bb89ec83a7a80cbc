"""Layers of networks in torch, for training; `layers` computes the same in numpy."""

import torch
from torch import Tensor, nn

from .directed import DirectedGraph


class TorchGraph:
    """The index arrays and measurements of a directed graph as tensors; float32."""

    def __init__(self, graph: DirectedGraph) -> None:
        self.n = graph.n
        self.at = torch.from_numpy(graph.at.astype("int64"))
        self.other = torch.from_numpy(graph.other.astype("int64"))
        self.reverse = torch.from_numpy(graph.reverse.astype("int64"))
        self.degree = torch.from_numpy(graph.degree.astype("float32"))
        self.rotations = torch.from_numpy(graph.rotations.astype("float32"))
        self.quaternions = torch.from_numpy(graph.quaternions.astype("float32"))

    def sums(self, values: Tensor) -> Tensor:
        """(n, k) sum over the edges of each camera of values (2m, k)."""
        return values.new_zeros((self.n, *values.shape[1:])).index_add(0, self.at, values)

    def maxima(self, values: Tensor) -> Tensor:
        """(n, k) maximum over the edges of each camera of values (2m, k)."""
        to = self.at[:, None].expand(-1, values.shape[1])
        return values.new_zeros((self.n, values.shape[1])).scatter_reduce(0, to, values, "amax", include_self=False)

    def means(self, values: Tensor) -> Tensor:
        """(n, k) mean over the edges of each camera of values (2m, k)."""
        return self.sums(values) / self.degree[:, None]


class EdgeConv(nn.Module):
    """Messages m_e = W2 relu(W1 [x_i, x_j, f_e] + c1) + c2 of directed edges e = (i, j), and their means at cameras.

    The message function of NeuRoRA, MSP and RAGO. W1 is kept in three parts, so that camera features are multiplied
    before they are gathered.

    Parameters
    ----------
    camera, edge, hidden
        Widths of the camera features (0: there are none), of the edge features and of the result.
    """

    def __init__(self, camera: int, edge: int, hidden: int) -> None:
        super().__init__()
        self.of_edge = nn.Linear(edge, hidden)
        if camera:
            self.of_camera = nn.Linear(camera, hidden, bias=False)
            self.of_other = nn.Linear(camera, hidden, bias=False)
        self.out = nn.Linear(hidden, hidden)

    def forward(self, graph: TorchGraph, cameras: Tensor | None, edges: Tensor) -> tuple[Tensor, Tensor]:
        """Camera features (n, h) and edge features (2m, h), before any activation."""
        hidden = self.of_edge(edges)
        if cameras is not None:
            hidden = hidden + self.of_camera(cameras)[graph.at] + self.of_other(cameras)[graph.other]
        message = self.out(torch.relu(hidden))
        return graph.means(message), message
