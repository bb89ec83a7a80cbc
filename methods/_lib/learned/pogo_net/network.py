"""The network in numpy: see the classes in `torch_network`."""

from itertools import count

import numpy as np

from bench import Floats

from ..directed import DirectedGraph
from ..layers import Arrays, linear, sigmoid, within

EMPTY = 1e-3  # as in `torch_network`


def gates(arrays: Arrays, graph: DirectedGraph, features: Floats) -> Floats:
    """(m,) gates of the edges of the problem, in (0, 1), of features (2m, k) of the directed edges."""
    edges = _silu(linear(within(arrays, "embed"), features))
    for index in count():
        layer = within(arrays, f"layers.{index}")
        if not layer:
            break
        edges = _gated(layer, graph, edges)
    logits = linear(within(arrays, "head"), edges)[:, 0]
    result = np.empty(len(graph.edge) // 2)
    result[graph.edge] = sigmoid(logits + logits[graph.reverse])
    return result


def _gated(arrays: Arrays, graph: DirectedGraph, edges: Floats) -> Floats:
    """What `GatedLayer` does."""
    gates = sigmoid(linear(within(arrays, "gate"), edges))
    cameras = graph.sums(gates * edges) / (graph.sums(gates) + np.float32(EMPTY))
    hidden = linear(within(arrays, "own"), edges)
    hidden += (edges @ arrays["back.weight"].T)[graph.reverse]
    hidden += (cameras @ arrays["camera.weight"].T)[graph.at]
    hidden += (cameras @ arrays["other.weight"].T)[graph.other]
    return edges + linear(within(arrays, "out"), _silu(hidden))


def _silu(x: Floats) -> Floats:
    return x * sigmoid(x)
