"""Gated messages over directed edges, in numpy: see the classes in `torch_gated`."""

from itertools import count

import numpy as np

from bench import Floats

from .directed import DirectedGraph
from .layers import Arrays, linear, sigmoid, within

EMPTY = 1e-3  # as in `torch_gated`


def gated(arrays: Arrays, graph: DirectedGraph, features: Floats) -> Floats:
    """(2m, o) what the network says of the directed edges, of their features (2m, k)."""
    edges = _silu(linear(within(arrays, "embed"), features))
    for index in count():
        layer = within(arrays, f"layers.{index}")
        if not layer:
            break
        edges = _messages(layer, graph, edges)
    return linear(within(arrays, "head"), edges)


def _messages(arrays: Arrays, graph: DirectedGraph, edges: Floats) -> Floats:
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
