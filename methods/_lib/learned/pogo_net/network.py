"""The gates of edges, in numpy: see `torch_network`."""

import numpy as np

from bench import Floats

from ..directed import DirectedGraph
from ..gated import gated
from ..layers import Arrays, sigmoid


def gates(arrays: Arrays, graph: DirectedGraph, features: Floats) -> Floats:
    """(m,) gates of the edges of the problem, in (0, 1), of features (2m, k) of the directed edges."""
    logits = gated(arrays, graph, features)[:, 0]
    result = np.empty(len(graph.edge) // 2)
    result[graph.edge] = sigmoid(logits + logits[graph.reverse])
    return result
