"""Layers of networks in numpy, for `solve`: each computes what the layer of its name in `torch_layers` does."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bench import Floats

from .directed import DirectedGraph

Arrays = Mapping[str, NDArray[np.float32]]


def within(arrays: Arrays, name: str) -> Arrays:
    """The arrays of a part of a network, by their names within it."""
    return {key.removeprefix(f"{name}."): array for key, array in arrays.items() if key.startswith(f"{name}.")}


def linear(arrays: Arrays, x: Floats) -> Floats:
    """``weight`` (k, j) times x (..., j), plus ``bias`` (k,)."""
    return x @ arrays["weight"].T + arrays["bias"]


def relu(x: Floats) -> Floats:
    """The positive part."""
    return np.maximum(x, 0)


def sigmoid(x: Floats) -> Floats:
    """1 / (1 + exp(-x)), without overflow."""
    return 0.5 * (1 + np.tanh(0.5 * x))


def edge_conv(arrays: Arrays, graph: DirectedGraph, cameras: Floats | None, edges: Floats) -> tuple[Floats, Floats]:
    """One EdgeConv: see `torch_layers.EdgeConv`.

    Parameters
    ----------
    cameras
        (n, a), or None where cameras have no features.
    edges
        (2m, b).

    Returns
    -------
    cameras, edges
        (n, h) and (2m, h), before any activation.
    """
    hidden = edges @ arrays["of_edge.weight"].T + arrays["of_edge.bias"]
    if cameras is not None:
        hidden += (cameras @ arrays["of_camera.weight"].T)[graph.at]
        hidden += (cameras @ arrays["of_other.weight"].T)[graph.other]
    message = linear(within(arrays, "out"), relu(hidden))
    return graph.means(message), message
