"""RAGO in numpy: what `solve` computes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench import Floats

from ..directed import DirectedGraph
from ..layers import Arrays, edge_conv, linear, relu, sigmoid, within
from ..quaternions import inverse, positive, product, unit

Array = NDArray[Any]  # of float32, but for indices

SUPPORT = 10  # triangles at an edge, of the tree that it starts from
CAMERA_UPDATES = 4  # after each update of the edges
WIDTH, CONVOLUTIONS = 24, 3
COST = 4  # numbers that tell a residual
UNIT = 0.02  # radians; residuals below are told as they are, larger ones by their logarithm
SCALE = 0.02  # radians; of the loss whose weights those of edges are before anything is learned
MOST = 4.0  # by which the logarithm of a weight may differ from that
SLOPE = 0.2  # of the leaky rectifier
SHORTEST = 0.25  # share of a step that is always taken
SMALL = 1e-6  # radians below which lengths are not told apart


@dataclass(frozen=True)
class Found:
    """Cameras (n, 4), rectified edges (2m, 4), and the weights (2m, 3) of the last camera update, by axis."""

    cameras: Floats
    edges: Floats
    weights: Array


def solve(
    arrays: Arrays, graph: DirectedGraph, start: Floats, outer: int, camera_updates: int = CAMERA_UPDATES
) -> Found:
    """Rectify edges and move cameras, in turn.

    Parameters
    ----------
    arrays
        Parameters of `torch_network.Rago`, by name.
    start
        (n, 4) cameras as unit quaternions.
    outer, camera_updates
        How often edges are rectified, and cameras moved each time.
    """
    network = _Network(arrays, graph)
    cameras, edges, weights = start, graph.quaternions, np.ones((len(graph.at), 3))
    for _ in range(outer):
        edges = network.rectified(cameras, edges)
        for _ in range(camera_updates):
            cameras, weights = network.moved(cameras, edges)
    return Found(cameras, edges, weights)


class _Network:
    """The network on one graph, with the features of its measurements and the states of its recurrent units."""

    def __init__(self, arrays: Arrays, graph: DirectedGraph) -> None:
        self._graph = graph
        self._parts = {name: within(arrays, name) for name in {key.split(".")[0] for key in arrays}}
        self._log_degree = np.log(graph.degree).astype(np.float32)[:, None]
        self._of_cameras, self._of_edges = (relu(x) for x in self._told(self._parts["features"]))
        self._h_cameras, self._h_edges = (np.tanh(x) for x in self._told(self._parts["states"]))

    def _told(self, arrays: Arrays) -> tuple[Array, Array]:
        quaternions = self._graph.quaternions.astype(np.float32)
        cameras, edges = _conv(within(arrays, "conv"), self._graph, None, quaternions)
        return mlp(within(arrays, "of_cameras"), relu(cameras)), mlp(within(arrays, "of_edges"), relu(edges))

    def rectified(self, cameras: Floats, edges: Floats) -> Floats:
        """Edges (2m, 4) after one more update."""
        predicted, measured = self._predicted(cameras), self._graph.quaternions
        to_cameras, to_measured = difference(edges, predicted), difference(edges, measured)
        costs = np.concatenate([told(difference(measured, predicted)), told(to_cameras), told(to_measured)], axis=1)
        _, read = self._cost_net("edge_cost", costs)
        self._h_edges = gru(self._parts["edge_gru"], self._h_edges, read, self._of_edges)
        gates = sigmoid(mlp(self._parts["edge_head"], self._h_edges))
        return turned(edges, -gates[:, :3] * to_cameras - gates[:, 3:] * to_measured)

    def moved(self, cameras: Floats, edges: Floats) -> tuple[Floats, Array]:
        """Cameras (n, 4) after one more update, and the weights (2m, 3) of that."""
        graph, predicted = self._graph, self._predicted(cameras)
        pull = difference(graph.quaternions, predicted)
        costs = np.concatenate([told(pull), told(difference(edges, predicted))], axis=1)
        at_cameras, at_edges = self._cost_net("camera_cost", costs)
        self._h_cameras = gru(self._parts["camera_gru"], self._h_cameras, at_cameras, self._of_cameras)
        _, read = _conv(self._parts["weight_conv"], graph, self._h_cameras, at_edges)
        change = MOST * np.tanh(linear(self._parts["weight"], relu(read)) / MOST)
        weights = np.exp(change) / (1 + (pull**2).sum(axis=1, keepdims=True) / SCALE**2) ** 2
        mean = graph.sums(weights * pull) / graph.sums(weights)
        length = SHORTEST + (1 - SHORTEST) * sigmoid(mlp(self._parts["step_head"], self._h_cameras))
        return turned(cameras, length * mean), weights

    def _predicted(self, cameras: Floats) -> Floats:
        return product(cameras[self._graph.at], inverse(cameras[self._graph.other]))

    def _cost_net(self, name: str, costs: Array) -> tuple[Array, Array]:
        arrays, graph = self._parts[name], self._graph
        x = np.concatenate([self._of_cameras, _means(graph, np.abs(costs)), self._log_degree], axis=1)
        e = self._of_edges
        for k in range(CONVOLUTIONS):
            x, e = _conv(within(arrays, f"convs.{k}"), graph, x, np.concatenate([e, costs], axis=1))
            x, e = relu(x), relu(e)
        return x, e


def mlp(arrays: Arrays, x: Array) -> Array:
    """Linear layers with leaky rectifiers between them."""
    count = sum(name.endswith(".bias") for name in arrays)
    for k in range(count):
        x = linear(within(arrays, f"layers.{k}"), np.where(x < 0, SLOPE * x, x).astype(np.float32) if k else x)
    return x


def gru(arrays: Arrays, hidden: Array, cost: Array, features: Array) -> Array:
    """The new state (k, width) of a recurrent unit: see `torch_network.Gru`."""
    seen = np.concatenate([mlp(within(arrays, "fusion"), np.concatenate([cost, features], axis=1)), features], axis=1)
    both = sigmoid(linear(within(arrays, "gates"), np.concatenate([hidden, seen], axis=1)))
    update, reset = np.split(both, 2, axis=1)
    candidate = np.tanh(linear(within(arrays, "candidate"), np.concatenate([reset * hidden, seen], axis=1)))
    return (1 - update) * hidden + update * candidate


def difference(a: Floats, b: Floats) -> Floats:
    """Of a b^-1 the axis times twice the sine of half the angle (k, 3): nearly its rotation vector, where small."""
    return 2 * positive(product(a, inverse(b)))[..., 1:]


def turned(q: Floats, step: Floats) -> Floats:
    """Unit quaternions (k, 4) with a small rotation on their left, whose tangent of half the angle is half a step."""
    return unit(product(np.concatenate([np.ones((len(step), 1)), 0.5 * step], axis=1), q))


def told(residual: Floats) -> Array:
    """Residuals (2m, 3) and their lengths, (2m, 4), on a scale that shows degrees as well as right angles."""
    length = np.sqrt((residual**2).sum(axis=1, keepdims=True) + SMALL**2)
    return np.arcsinh(np.concatenate([residual, length], axis=1) / UNIT).astype(np.float32)


def _conv(arrays: Arrays, graph: DirectedGraph, cameras: Array | None, edges: Array) -> tuple[Array, Array]:
    found, messages = edge_conv(arrays, graph, cameras, edges)
    return found.astype(np.float32), messages


def _means(graph: DirectedGraph, values: Array) -> Array:
    return graph.means(values).astype(np.float32)
