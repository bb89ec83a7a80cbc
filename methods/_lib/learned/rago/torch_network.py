"""RAGO in torch, for training; `network` computes the same in numpy."""

from itertools import pairwise

import torch
from torch import Tensor, nn

from ..torch_layers import EdgeConv, TorchGraph
from ..torch_quaternions import inverse, positive, product, unit
from .network import CONVOLUTIONS, COST, MOST, SCALE, SHORTEST, SLOPE, SMALL, UNIT, WIDTH

_GATE = -4.0  # logit of an edge's first moves


class Mlp(nn.Module):
    """Linear layers with leaky rectifiers between them."""

    def __init__(self, *widths: int) -> None:
        super().__init__()
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(widths))

    def forward(self, x: Tensor) -> Tensor:
        """(..., last width)."""
        for k, layer in enumerate(self.layers):
            x = layer(nn.functional.leaky_relu(x, SLOPE) if k else x)
        return x


class Features(nn.Module):
    """What the measurements alone tell of cameras and directed edges: one EdgeConv, and an MLP for each kind."""

    def __init__(self) -> None:
        super().__init__()
        self.conv = EdgeConv(0, 4, WIDTH)
        self.of_cameras, self.of_edges = Mlp(WIDTH, WIDTH, WIDTH), Mlp(WIDTH, WIDTH, WIDTH)

    def forward(self, graph: TorchGraph) -> tuple[Tensor, Tensor]:
        """(n, width) and (2m, width)."""
        cameras, edges = self.conv(graph, None, graph.quaternions)
        return self.of_cameras(torch.relu(cameras)), self.of_edges(torch.relu(edges))


class CostNet(nn.Module):
    """EdgeConvs over the graph of costs, each of which sees them.

    Parameters
    ----------
    cost
        Numbers that tell the costs of an edge.
    """

    def __init__(self, cost: int) -> None:
        super().__init__()
        first = EdgeConv(WIDTH + cost + 1, WIDTH + cost, WIDTH)
        self.convs = nn.ModuleList([first, *(EdgeConv(WIDTH, WIDTH + cost, WIDTH) for _ in range(CONVOLUTIONS - 1))])

    def forward(self, graph: TorchGraph, cameras: Tensor, edges: Tensor, costs: Tensor) -> tuple[Tensor, Tensor]:
        """What it reads at cameras (n, width) and edges (2m, width), from their features and the costs (2m, cost)."""
        x = torch.cat([cameras, graph.means(costs.abs()), graph.degree.log()[:, None]], 1)
        e = edges
        for conv in self.convs:
            x, e = conv(graph, x, torch.cat([e, costs], 1))
            x, e = torch.relu(x), torch.relu(e)
        return x, e


class Gru(nn.Module):
    """A gated recurrent unit with linear gates, behind a fusion of what was read and features."""

    def __init__(self) -> None:
        super().__init__()
        self.fusion = Mlp(2 * WIDTH, WIDTH, WIDTH)
        self.gates, self.candidate = nn.Linear(3 * WIDTH, 2 * WIDTH), nn.Linear(3 * WIDTH, WIDTH)

    def forward(self, hidden: Tensor, read: Tensor, features: Tensor) -> Tensor:
        """The new state (k, width)."""
        seen = torch.cat([self.fusion(torch.cat([read, features], 1)), features], 1)
        update, reset = torch.sigmoid(self.gates(torch.cat([hidden, seen], 1))).chunk(2, 1)
        candidate = torch.tanh(self.candidate(torch.cat([reset * hidden, seen], 1)))
        return (1 - update) * hidden + update * candidate


class Rago(nn.Module):
    """The network; the names of its parameters are those that `network` reads."""

    def __init__(self) -> None:
        super().__init__()
        self.features, self.states = Features(), Features()
        self.edge_cost, self.edge_gru, self.edge_head = CostNet(3 * COST), Gru(), Mlp(WIDTH, WIDTH, 6)
        self.camera_cost, self.camera_gru, self.step_head = CostNet(2 * COST), Gru(), Mlp(WIDTH, WIDTH, 3)
        self.weight_conv, self.weight = EdgeConv(WIDTH, WIDTH, WIDTH), nn.Linear(WIDTH, 3)
        for last, bias in ((self.edge_head.layers[-1], _GATE), (self.step_head.layers[-1], 2.0), (self.weight, 0.0)):
            nn.init.zeros_(last.weight)  # type: ignore[arg-type]
            nn.init.constant_(last.bias, bias)  # type: ignore[arg-type]

    def forward(
        self, graph: TorchGraph, cameras: Tensor, outer: int, camera_updates: int
    ) -> tuple[list[Tensor], list[Tensor]]:
        """Cameras (n, 4) after every update of theirs from (n, 4), and edges (2m, 4) after every update of theirs.

        No gradient passes from one update to the next but through the states of the recurrent units.
        """
        features = [torch.relu(x) for x in self.features(graph)]
        h_cameras, h_edges = (torch.tanh(x) for x in self.states(graph))
        edges = graph.quaternions
        moved, rectified = [], []
        for _ in range(outer):
            edges, h_edges = self._rectified(graph, cameras.detach(), edges.detach(), features, h_edges)
            rectified.append(edges)
            for _ in range(camera_updates):
                cameras, h_cameras = self._moved(graph, cameras.detach(), edges.detach(), features, h_cameras)
                moved.append(cameras)
        return moved, rectified

    def _rectified(
        self, graph: TorchGraph, cameras: Tensor, edges: Tensor, features: list[Tensor], hidden: Tensor
    ) -> tuple[Tensor, Tensor]:
        predicted, measured = relative(graph, cameras), graph.quaternions
        to_cameras, to_measured = difference(edges, predicted), difference(edges, measured)
        costs = torch.cat([told(difference(measured, predicted)), told(to_cameras), told(to_measured)], 1)
        _, read = self.edge_cost(graph, *features, costs)
        hidden = self.edge_gru(hidden, read, features[1])
        gates = torch.sigmoid(self.edge_head(hidden))
        return turned(edges, -gates[:, :3] * to_cameras - gates[:, 3:] * to_measured), hidden

    def _moved(
        self, graph: TorchGraph, cameras: Tensor, edges: Tensor, features: list[Tensor], hidden: Tensor
    ) -> tuple[Tensor, Tensor]:
        predicted = relative(graph, cameras)
        pull = difference(graph.quaternions, predicted)
        costs = torch.cat([told(pull), told(difference(edges, predicted))], 1)
        at_cameras, at_edges = self.camera_cost(graph, *features, costs)
        hidden = self.camera_gru(hidden, at_cameras, features[0])
        _, read = self.weight_conv(graph, hidden, at_edges)
        change = MOST * torch.tanh(self.weight(torch.relu(read)) / MOST)
        weights = change.exp() / (1 + pull.square().sum(1, keepdim=True) / SCALE**2) ** 2
        mean = graph.sums(weights * pull) / graph.sums(weights)
        length = SHORTEST + (1 - SHORTEST) * torch.sigmoid(self.step_head(hidden))
        return turned(cameras, length * mean), hidden


def relative(graph: TorchGraph, cameras: Tensor) -> Tensor:
    """Of cameras (n, 4) the relative rotations (2m, 4) along directed edges."""
    return product(cameras.index_select(0, graph.at), inverse(cameras.index_select(0, graph.other)))


def difference(a: Tensor, b: Tensor) -> Tensor:
    """Of a b^-1 the axis times twice the sine of half the angle (k, 3)."""
    return 2 * positive(product(a, inverse(b)))[..., 1:]


def turned(q: Tensor, step: Tensor) -> Tensor:
    """Unit quaternions (k, 4) with a small rotation on their left."""
    return unit(product(torch.cat([torch.ones_like(step[:, :1]), 0.5 * step], 1), q))


def told(residual: Tensor) -> Tensor:
    """Residuals (2m, 3) and their lengths, (2m, 4), on a scale that shows degrees as well as right angles."""
    length = (residual.square().sum(1, keepdim=True) + SMALL**2).sqrt()
    return torch.asinh(torch.cat([residual, length], 1) / UNIT)
