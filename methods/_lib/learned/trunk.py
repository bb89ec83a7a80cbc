"""The four layers that CleanNet and FineNet are made of, in numpy: see `torch_trunk.Trunk`."""

import numpy as np

from bench import Floats

from .directed import DirectedGraph
from .layers import Arrays, edge_conv, relu, within


def trunk(arrays: Arrays, graph: DirectedGraph, cameras: Floats | None, edges: Floats) -> tuple[Floats, Floats]:
    """Features of cameras (n, h) and of directed edges (2m, h), both after the last activation.

    Parameters
    ----------
    cameras
        (n, a), or None where cameras have no features.
    edges
        (2m, b).
    """

    def layer(name: str, x: Floats | None, e: Floats) -> tuple[Floats, Floats]:
        of_cameras, of_edges = edge_conv(within(arrays, name), graph, x, e)
        return relu(of_cameras), relu(of_edges)

    x1, e1 = layer("first", cameras, edges)
    x2, e2 = layer("second", x1, np.hstack([edges, e1]))
    x3, e3 = layer("third", np.hstack([x2, x1]), np.hstack([e2, e1]))
    return layer("fourth", np.hstack([x3, x2]), np.hstack([e3, e2]))
