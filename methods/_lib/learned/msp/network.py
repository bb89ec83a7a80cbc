"""The two networks of MSP in numpy: see the classes in `torch_network`; and what they see."""

import numpy as np

from bench import Floats, so3

from ..directed import DirectedGraph
from ..layers import Arrays, linear, relu, within
from ..quaternions import inverse, product
from ..trunk import trunk

LARGEST = 10.0  # as in `torch_network`
LEAST = 0.1  # added to a residual, in units of the noise, before its logarithm is taken
MANY = 5.0  # of a logit that counts as one


def measured(graph: DirectedGraph, triangles: Floats) -> Floats:
    """(2m, 4 + FEATURES) what is measured, a unit quaternion, and what the triangles (m, FEATURES) say; float32."""
    return np.hstack([graph.quaternions, triangles[graph.edge]]).astype(np.float32)


def seen(graph: DirectedGraph, triangles: Floats, logits: Floats, asked: Floats, noise: float) -> Floats:
    """(2m, 5 + FEATURES) what cameras are asked, in units of the noise, with logits (m,) of the edges; float32."""
    size = np.linalg.norm(asked, axis=1) / noise
    return np.column_stack(
        [np.arcsinh(asked / noise), np.log(LEAST + size), logits[graph.edge] / MANY, triangles[graph.edge]]
    ).astype(np.float32)


def asked_of(graph: DirectedGraph, cameras: Floats) -> Floats:
    """(2m, 3) rotation vectors of R_ij R_j R_i^T, what each directed edge asks camera i to turn by, in its frame."""
    residuals = product(product(graph.quaternions, cameras[graph.other]), inverse(cameras)[graph.at])
    return so3.log(so3.from_quaternion(residuals))


def edge_logits(arrays: Arrays, graph: DirectedGraph, edges: Floats) -> Floats:
    """(m,) what `WeightNet` says of the edges of the problem."""
    features = trunk(within(arrays, "trunk"), graph, None, edges)[1]
    logits = linear(within(arrays, "inlier_out"), relu(linear(within(arrays, "inlier"), features)))[:, 0]
    result = np.empty(len(logits) // 2)
    result[graph.edge] = (logits + logits[graph.reverse]) / 2
    return result


def camera_steps(arrays: Arrays, graph: DirectedGraph, edges: Floats, asked: Floats) -> Floats:
    """(n, 3) what `VoteNet` makes of features (2m, SEEN) and of what is asked (2m, 3)."""
    logits = linear(within(arrays, "vote"), trunk(within(arrays, "trunk"), graph, None, edges)[1])
    votes = np.exp(LARGEST * np.tanh(logits / LARGEST))
    return graph.sums(votes * asked) / graph.sums(votes)
