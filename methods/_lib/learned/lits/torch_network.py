"""LITS in torch, for training; `network` computes the same in numpy."""

import torch
from torch import Tensor, nn

from ..torch_layers import TorchGraph
from .network import CAMERA, GRAPH, HIDDEN, ITERATIONS, NEAR, NEARBY, RESIDUAL, SMALL

Steps = list[tuple[Tensor, Tensor]]


class Lits(nn.Module):
    """The layer that is repeated; the names of its parameters are those that `network` reads.

    What camera i gets from an edge to j is a function of the residual of the edge and of the features of i and j. Its
    first linear map is that of messages and trust together, and is applied to the features before they are gathered.
    """

    def __init__(self) -> None:
        super().__init__()
        self.first = nn.Linear(RESIDUAL + 2 * CAMERA, 2 * HIDDEN)
        self.message = nn.Linear(HIDDEN, HIDDEN)
        self.trust = nn.Linear(HIDDEN, HIDDEN // 2)
        self.compare = nn.Linear(HIDDEN, HIDDEN)
        self.logit = nn.Linear(HIDDEN, 1)
        self.graph_in = nn.Linear(GRAPH + CAMERA, HIDDEN)
        self.graph_out = nn.Linear(HIDDEN, GRAPH)
        self.camera_in = nn.Linear(HIDDEN + CAMERA + GRAPH, HIDDEN)
        self.camera_out = nn.Linear(HIDDEN, CAMERA + 3)

    def forward(self, graph: TorchGraph, iterations: int = ITERATIONS) -> Steps:
        """Rotations (n, 3, 3) after every iteration, with the logits (2m,) of the trust in the edges that led there."""
        rotations = torch.eye(3).repeat(graph.n, 1, 1)
        camera, whole = torch.zeros(graph.n, CAMERA), torch.zeros(GRAPH)
        steps: Steps = []
        for _ in range(iterations):
            whole = self.graph_out(torch.relu(self.graph_in(torch.cat([whole, camera.mean(dim=0)]))))
            gathered, logits = self._gathered(graph, rotations, camera)
            told = torch.cat([gathered, camera, whole.expand(graph.n, -1)], dim=1)
            change = self.camera_out(torch.relu(self.camera_in(told)))
            camera = camera + change[:, :CAMERA]
            rotations = exp(squashed(change[:, CAMERA:])) @ rotations
            steps.append((rotations, logits))
        return steps

    def _gathered(self, graph: TorchGraph, rotations: Tensor, camera: Tensor) -> tuple[Tensor, Tensor]:
        """Directions (n, h) of the trusted messages to each camera, and the logits (2m,) of the trust."""
        hidden = torch.relu(self._hidden(graph, rotations, camera))
        messages = torch.relu(self.message(hidden[:, :HIDDEN]))
        trust = torch.relu(self.trust(hidden[:, HIDDEN:]))
        most = graph.maxima(trust)
        own, others = self.compare.weight[:, : HIDDEN // 2], self.compare.weight[:, HIDDEN // 2 :]
        compared = nn.functional.linear(trust, own, self.compare.bias)
        compared = torch.relu(compared + (most @ others.T).index_select(0, graph.at))
        logits = self.logit(compared)
        total = graph.sums(torch.sigmoid(logits) * messages)
        length = torch.sqrt((total**2).sum(dim=1, keepdim=True) + SMALL**2)
        return total / (length + NEAR), logits[:, 0]

    def _hidden(self, graph: TorchGraph, rotations: Tensor, camera: Tensor) -> Tensor:
        """(2m, 2h) first linear map of what an edge has to tell."""
        of_residual, of_cameras = self.first.weight[:, :RESIDUAL], self.first.weight[:, RESIDUAL:]
        wanted = graph.rotations @ rotations.index_select(0, graph.other)
        residual = rotations.index_select(0, graph.at) @ wanted.transpose(1, 2)
        seen = torch.cat([residual.reshape(-1, 9), compressed(residual)], dim=1)
        hidden = nn.functional.linear(seen, of_residual, self.first.bias)
        hidden = hidden + (camera @ of_cameras[:, :CAMERA].T).index_select(0, graph.at)
        return hidden + (camera @ of_cameras[:, CAMERA:].T).index_select(0, graph.other)


def compressed(residual: Tensor) -> Tensor:
    """(2m, 3) axes of residuals, as long as the inverse hyperbolic sine of the sine of the angle / `NEARBY`."""
    entries = residual.reshape(-1, 9)
    axial = 0.5 * (entries[:, [7, 2, 3]] - entries[:, [5, 6, 1]])
    length = torch.sqrt((axial**2).sum(dim=1, keepdim=True) + SMALL**2)
    return axial * torch.asinh(length / NEARBY) / length


def squashed(v: Tensor) -> Tensor:
    """Rotation vectors (n, 3) shorter than half a turn: pi |v|^2 / (1 + |v|^2) v / |v|."""
    square = (v**2).sum(dim=1, keepdim=True)
    return v * torch.pi * torch.sqrt(square + SMALL**2) / (1 + square)


def exp(v: Tensor) -> Tensor:
    """Rotations (n, 3, 3) of rotation vectors (n, 3), by Rodrigues' formula."""
    angle = torch.sqrt((v**2).sum(dim=1) + SMALL**2)[:, None, None]
    x, y, z = v.unbind(dim=1)
    zero = torch.zeros_like(x)
    k = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=1).reshape(-1, 3, 3)
    half = torch.sin(angle / 2) / (angle / 2)
    return torch.eye(3) + torch.sin(angle) / angle * k + 0.5 * half**2 * (k @ k)
