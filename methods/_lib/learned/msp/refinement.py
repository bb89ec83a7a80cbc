"""What MSP does to its weights at test time: it makes what the sources tell agree with the measurements."""

import math
from collections.abc import Sequence

import numpy as np

from bench import Floats, Ints

from ...loops.edge_kernels import compiled
from ..directed import DirectedGraph
from ..layers import sigmoid
from .propagation import Wave, gradient, propagated

STEEPNESS = 0.6  # of the sigmoid that makes weights of logits
RATE, MOMENTS, TINY = 1.5, (0.9, 0.999), 1e-8  # of Adam
BEND = 0.002  # where the smooth L1 loss turns from a square into a line


def weights_of(logits: Floats) -> Floats:
    """(m,) in (0, 1), of logits (m,)."""
    return sigmoid(STEEPNESS * logits)


def refined(
    graph: DirectedGraph, logits: Floats, sources: Sequence[int], rounds: int, steps: int
) -> tuple[Floats, list[float]]:
    """Logits (m,) after some steps of Adam, and the loss of each source (k,) at them.

    The loss is the sum over the sources of the mean over the edges of smoothL1(c_ij n(q_ij q_j q_i^-1)), where n is
    the sum of the absolute values of a quaternion's vector part and of 1 - |w|, and c_ij the weight of the edge, held
    fixed in each step.
    """
    mean, square = np.zeros_like(logits), np.zeros_like(logits)
    for step in range(1, steps + 1):
        slope = _losses(graph, logits, sources, rounds)[1]
        mean += (1 - MOMENTS[0]) * (slope - mean)
        square += (1 - MOMENTS[1]) * (slope**2 - square)
        size = np.sqrt(square / (1 - MOMENTS[1] ** step)) + TINY
        logits = logits - RATE * mean / (1 - MOMENTS[0] ** step) / size
    return logits, _losses(graph, logits, sources, rounds)[0]


def _losses(graph: DirectedGraph, logits: Floats, sources: Sequence[int], rounds: int) -> tuple[list[float], Floats]:
    """The loss of each source, and the derivative of their sum with respect to the logits (m,)."""
    weights = weights_of(logits)
    slope, losses = np.zeros_like(weights), []
    for source in sources:
        wave = propagated(graph, weights, source, rounds)
        loss, of_cameras = edge_loss(graph, weights, wave)
        slope += gradient(graph, weights, wave, of_cameras)
        losses.append(loss)
    return losses, slope * STEEPNESS * weights * (1 - weights)


def edge_loss(graph: DirectedGraph, confidence: Floats, wave: Wave) -> tuple[float, Floats]:
    """The loss of what a source tells, see `refined`, with its derivative by the cameras (n, 4)."""
    of_cameras, loss = np.zeros((graph.n, 4)), np.zeros(1)
    _add_losses(graph.at, graph.other, graph.quaternions, confidence[graph.edge], wave.last, of_cameras, loss)
    return float(loss[0]), of_cameras


@compiled
def _add_losses(
    at: Ints, other: Ints, measured: Floats, confidence: Floats, cameras: Floats, of_cameras: Floats, loss: Floats
) -> None:
    """Add the mean over the directed edges to `loss` (1,), and its derivatives to `of_cameras` (n, 4)."""
    for e in range(len(at)):
        i, j = at[e], other[e]
        a, b, c, d = measured[e, 0], measured[e, 1], measured[e, 2], measured[e, 3]
        p, q, r, s = cameras[j, 0], cameras[j, 1], cameras[j, 2], cameras[j, 3]
        f, g, h, k = a * p - b * q - c * r - d * s, a * q + b * p + c * s - d * r, 0.0, 0.0
        h, k = a * r - b * s + c * p + d * q, a * s + b * r - c * q + d * p
        p, q, r, s = cameras[i, 0], -cameras[i, 1], -cameras[i, 2], -cameras[i, 3]
        w, x = f * p - g * q - h * r - k * s, f * q + g * p + h * s - k * r
        y, z = f * r - g * s + h * p + k * q, f * s + g * r - h * q + k * p
        size = confidence[e] * (1 - abs(w) + abs(x) + abs(y) + abs(z))
        if size < BEND:
            loss[0] += 0.5 * size * size / BEND / len(at)
            slope = size / BEND
        else:
            loss[0] += (size - 0.5 * BEND) / len(at)
            slope = 1.0
        slope *= confidence[e] / len(at)
        w, x = -math.copysign(slope, w), math.copysign(slope, x)
        y, z = math.copysign(slope, y), math.copysign(slope, z)
        # the residual is (f, g, h, k) times the conjugate of camera i, and (f, g, h, k) is measured times camera j
        f, g, h, k, p, q, r, s = (
            w * p + x * q + y * r + z * s,
            -w * q + x * p - y * s + z * r,
            -w * r + x * s + y * p - z * q,
            -w * s - x * r + y * q + z * p,
            f * w + g * x + h * y + k * z,
            f * x - g * w - h * z + k * y,
            f * y + g * z - h * w - k * x,
            f * z - g * y + h * x - k * w,
        )
        of_cameras[i, 0] += p
        of_cameras[i, 1] -= q
        of_cameras[i, 2] -= r
        of_cameras[i, 3] -= s
        of_cameras[j, 0] += a * f + b * g + c * h + d * k
        of_cameras[j, 1] += a * g - b * f - c * k + d * h
        of_cameras[j, 2] += a * h + b * k - c * f - d * g
        of_cameras[j, 3] += a * k - b * h + c * g - d * f
