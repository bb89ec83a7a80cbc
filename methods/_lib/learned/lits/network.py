"""LITS in numpy: what `solve` computes."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..directed import DirectedGraph
from ..layers import Arrays, linear, relu, sigmoid, within

Array = NDArray[Any]  # of float32, but for indices

ITERATIONS = 10
HIDDEN, CAMERA, GRAPH, RESIDUAL = 64, 16, 4, 9 + 3  # widths
NEAR = 1e-4  # added to the length that messages are divided by
NEARBY = 0.0175  # radians; residuals below are told as they are, larger ones by their logarithm as well
SMALL = 1e-7  # below which the length of a vector is not told apart from zero
_CHUNK = 4096  # directed edges at a time, so that what they tell stays in a cache


def solve(arrays: Arrays, graph: DirectedGraph, iterations: int = ITERATIONS) -> tuple[Array, Array]:
    """Repeat the layer, from the identity.

    Parameters
    ----------
    arrays
        Parameters of `torch_network.Lits`, by name.

    Returns
    -------
    rotations, trust
        (n, 3, 3), and the trust (2m,) in every directed edge in the last iteration, between 0 and 1.
    """
    network = {name: within(arrays, name) for name in {key.split(".")[0] for key in arrays}}
    rotations = np.tile(np.eye(3, dtype=np.float32), (graph.n, 1, 1))
    camera, whole = np.zeros((graph.n, CAMERA), np.float32), np.zeros(GRAPH, np.float32)
    gathered, trust = np.empty((graph.n, HIDDEN), np.float32), np.empty(len(graph.at), np.float32)
    measured = graph.rotations.astype(np.float32)
    for _ in range(iterations):
        whole = _mlp(network, "graph", np.concatenate([whole, camera.mean(axis=0)]))
        of_residual, of_at, of_other = np.split(network["first"]["weight"], [RESIDUAL, RESIDUAL + CAMERA], axis=1)
        at, other = camera @ of_at.T + network["first"]["bias"], camera @ of_other.T
        for cameras, edges in _chunks(graph):
            i, j = graph.at[edges], graph.other[edges]
            residual = (rotations[i] @ np.swapaxes(measured[edges] @ rotations[j], 1, 2)).reshape(-1, 9)
            hidden: Array = np.concatenate([residual, _compressed(residual)], axis=1) @ of_residual.T
            hidden += at[i]
            hidden += other[j]
            starts = graph.starts[cameras] - edges.start
            gathered[cameras], trust[edges] = _gathered(network, relu(hidden), starts, i - cameras.start)
        told = np.concatenate([gathered, camera, np.tile(whole, (graph.n, 1))], axis=1)
        change = _mlp(network, "camera", told)
        camera = camera + change[:, :CAMERA]
        rotations = _exp(_squashed(change[:, CAMERA:])) @ rotations
    return rotations, trust


def _gathered(network: Mapping[str, Arrays], hidden: Array, starts: Array, at: Array) -> tuple[Array, Array]:
    """Directions of the trusted messages to some cameras, and the trust in each of their edges."""
    messages = relu(linear(network["message"], hidden[:, :HIDDEN]))
    trust = relu(linear(network["trust"], hidden[:, HIDDEN:]))
    most = np.maximum.reduceat(trust, starts, axis=0)
    own, others = np.split(network["compare"]["weight"], 2, axis=1)
    compared = trust @ own.T
    compared += (most @ others.T + network["compare"]["bias"])[at]
    share = sigmoid(linear(network["logit"], relu(compared)))
    total = np.add.reduceat(share * messages, starts, axis=0)
    length = np.sqrt((total**2).sum(axis=1, keepdims=True) + SMALL**2)
    return total / (length + NEAR), share[:, 0]


def _chunks(graph: DirectedGraph) -> Iterator[tuple[slice, slice]]:
    """Cameras and their directed edges, a few thousand edges or one camera at a time."""
    ends = np.append(graph.starts, len(graph.at))
    first = 0
    while first < graph.n:
        last = max(first + 1, int(np.searchsorted(ends, ends[first] + _CHUNK, side="right")) - 1)
        yield slice(first, last), slice(int(ends[first]), int(ends[last]))
        first = last


def _mlp(network: Mapping[str, Arrays], name: str, x: Array) -> Array:
    return linear(network[f"{name}_out"], relu(linear(network[f"{name}_in"], x)))


def _compressed(residual: Array) -> Array:
    axial = np.float32(0.5) * (residual[:, [7, 2, 3]] - residual[:, [5, 6, 1]])
    length = np.sqrt((axial**2).sum(axis=1, keepdims=True) + SMALL**2)
    return axial * np.arcsinh(length / NEARBY) / length


def _squashed(v: Array) -> Array:
    square = (v**2).sum(axis=1, keepdims=True)
    return v * np.float32(np.pi) * np.sqrt(square + SMALL**2) / (1 + square)


def _exp(v: Array) -> Array:
    angle = np.sqrt((v**2).sum(axis=1) + SMALL**2)[:, None, None]
    k = np.zeros((len(v), 3, 3), np.float32)
    k[:, [2, 0, 1], [1, 2, 0]] = v
    k -= np.swapaxes(k, 1, 2)
    half = np.sin(angle / 2) / (angle / 2)
    return np.eye(3, dtype=np.float32) + np.sin(angle) / angle * k + 0.5 * half**2 * (k @ k)
