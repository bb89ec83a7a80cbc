"""CleanNet and FineNet in numpy: see the classes of these names in `torch_networks`."""

import numpy as np

from bench import Floats

from ..directed import DirectedGraph
from ..layers import Arrays, linear, within
from ..quaternions import inverse, positive, product, unit
from ..trunk import trunk

UNIT = 30.0  # FineNet sees and makes turns times this: with it small ones are told apart after far fewer steps


def clean_net(arrays: Arrays, graph: DirectedGraph) -> tuple[Floats, Floats]:
    """Logits (2m,) that edges are inliers, and what they should have measured, unit quaternions (2m, 4)."""
    q = graph.quaternions
    edges = trunk(within(arrays, "trunk"), graph, None, q)[1]
    logits = linear(within(arrays, "inlier_out"), linear(within(arrays, "inlier"), edges))[:, 0]
    change = linear(within(arrays, "rectified_out"), linear(within(arrays, "rectified"), edges))
    return logits, unit(q + change)


def fine_net(arrays: Arrays, graph: DirectedGraph, cameras: Floats) -> Floats:
    """One pass: better cameras (n, 4) than `cameras` (n, 4), unit quaternions in a world where the root is near 1."""
    cameras = positive(cameras)
    asked = residuals(graph, cameras) * np.array([1, *3 * [UNIT]])
    features = trunk(within(arrays, "trunk"), graph, cameras, asked)[0]
    turn = linear(within(arrays, "out"), features) / UNIT
    return unit(product(cameras, turn + np.array([1, 0, 0, 0])))


def residuals(graph: DirectedGraph, cameras: Floats) -> Floats:
    """(2m, 4) what each edge asks its camera to turn by, in the world: R_at^T R_at,other R_other."""
    asked = product(graph.quaternions, cameras[graph.other])
    return positive(product(inverse(cameras)[graph.at], asked))
