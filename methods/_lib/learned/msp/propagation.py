"""Multi-source propagation: a spanning tree that can be differentiated, without a derivative by torch.

From a source, rotations spread over the graph in rounds. In round t camera i becomes

    q_i <- u_i / |u_i|,    u_i = sum_j exp(8 w_ij l_j / L_i) s_ij q_ij q_j

over the neighbours j that are reached already and, where it is reached itself, over itself with w_ii = 1 and q_ii = 1.
The l_j are levels in [0, 1]: how reliable the best way from the source is so far, l_i <- max(l_i, max_j w_ij l_j), with
1 at the source; L_i is the largest of those in the sum. The signs s_ij = 1 or -1 turn every term to the side of q_i or,
where camera i was not reached, of the term of largest weight, q and -q being one rotation. (The sum of the weights of a
softmax would cancel in q_i.)
"""

import math
from dataclasses import dataclass

import numpy as np

from bench import Floats, Ints

from ...loops.edge_kernels import compiled
from ..directed import DirectedGraph

SHARPNESS = 8.0


@dataclass(frozen=True, eq=False)
class Wave:
    """What one source tells every camera, and the rounds that led there.

    Parameters
    ----------
    levels
        (t + 1, n) before the first round and after each.
    cameras
        (t + 1, n, 4) unit quaternions of R_i, the source's being the identity in the beginning; 0 where not reached.
    sides
        (t, n, 4) the term in the sum of each round to whose side the others are turned.
    """

    levels: Floats
    cameras: Floats
    sides: Floats

    @property
    def last(self) -> Floats:
        """(n, 4) the cameras after the last round."""
        return np.asarray(self.cameras[-1])


def propagated(graph: DirectedGraph, weights: Floats, source: int, rounds: int) -> Wave:
    """Spread rotations from a source; every camera must be within `rounds` edges of it.

    Parameters
    ----------
    weights
        (m,) of the edges of the problem, above 0 and at most 1.
    """
    levels, cameras = np.zeros((rounds + 1, graph.n)), np.zeros((rounds + 1, graph.n, 4))
    levels[0, source], cameras[0, source, 0] = 1, 1
    wave = Wave(levels, cameras, np.zeros((rounds, graph.n, 4)))
    _spread(graph.first, graph.other, graph.quaternions, weights[graph.edge], levels, cameras, wave.sides)
    return wave


def gradient(graph: DirectedGraph, weights: Floats, wave: Wave, of_cameras: Floats) -> Floats:
    """(m,) derivative with respect to the weights of a function whose derivative by `wave.last` is `of_cameras` (n, 4).

    Levels and signs are held fixed: the exponent is differentiated where it names w_ij, and not through l_j and L_i.
    """
    directed = np.zeros(len(graph.other))
    back = of_cameras.copy()
    for t in range(len(wave.sides) - 1, -1, -1):
        earlier = np.zeros_like(back)
        _collect(
            graph.first,
            graph.other,
            graph.quaternions,
            weights[graph.edge],
            wave.levels[t],
            wave.cameras[t],
            wave.sides[t],
            back,
            earlier,
            directed,
        )
        back = earlier
    return np.asarray(np.bincount(graph.edge, directed, minlength=len(weights)), dtype=float)


@compiled
def _spread(
    first: Ints, other: Ints, measured: Floats, weights: Floats, levels: Floats, cameras: Floats, sides: Floats
) -> None:
    """Fill `levels`, `cameras` and `sides`, see `Wave`, from what `levels` and `cameras` are before the first round."""
    terms = np.empty((1 + np.max(np.diff(first)), 4))
    shares = np.empty(len(terms))
    for t in range(len(sides)):
        for i in range(len(first) - 1):
            top, level = levels[t, i], levels[t, i]
            for e in range(first[i], first[i + 1]):
                top = max(top, levels[t, other[e]])
                level = max(level, weights[e] * levels[t, other[e]])
            if top == 0:
                continue
            levels[t + 1, i] = level
            count = 0
            if levels[t, i] > 0:
                shares[0] = levels[t, i] / top
                terms[0] = cameras[t, i]
                count = 1
            for e in range(first[i], first[i + 1]):
                j = other[e]
                if levels[t, j] == 0:
                    continue
                a, b, c, d = measured[e, 0], measured[e, 1], measured[e, 2], measured[e, 3]
                p, q, r, s = cameras[t, j, 0], cameras[t, j, 1], cameras[t, j, 2], cameras[t, j, 3]
                terms[count, 0] = a * p - b * q - c * r - d * s
                terms[count, 1] = a * q + b * p + c * s - d * r
                terms[count, 2] = a * r - b * s + c * p + d * q
                terms[count, 3] = a * s + b * r - c * q + d * p
                shares[count] = weights[e] * levels[t, j] / top
                count += 1
            best = 0 if levels[t, i] > 0 else np.argmax(shares[:count])
            a, b, c, d = terms[best, 0], terms[best, 1], terms[best, 2], terms[best, 3]
            sides[t, i] = terms[best]
            p, q, r, s = 0.0, 0.0, 0.0, 0.0
            for k in range(count):
                share = math.exp(SHARPNESS * shares[k])
                if a * terms[k, 0] + b * terms[k, 1] + c * terms[k, 2] + d * terms[k, 3] < 0:
                    share = -share
                p, q = p + share * terms[k, 0], q + share * terms[k, 1]
                r, s = r + share * terms[k, 2], s + share * terms[k, 3]
            scale = 1 / math.sqrt(p * p + q * q + r * r + s * s)
            cameras[t + 1, i, 0], cameras[t + 1, i, 1] = scale * p, scale * q
            cameras[t + 1, i, 2], cameras[t + 1, i, 3] = scale * r, scale * s


@compiled
def _collect(
    first: Ints,
    other: Ints,
    measured: Floats,
    weights: Floats,
    levels: Floats,
    cameras: Floats,
    sides: Floats,
    after: Floats,
    before: Floats,
    of_weights: Floats,
) -> None:
    """Add to `before` (n, 4) and `of_weights` (2m,) the derivatives through one round, given those `after` it (n, 4).

    Parameters
    ----------
    levels, cameras, sides
        (n,), (n, 4) and (n, 4), those that the round began with; see `Wave`.
    """
    terms = np.empty((1 + np.max(np.diff(first)), 4))
    shares = np.empty(len(terms))
    for i in range(len(first) - 1):
        top, p, q, r, s = levels[i], 0.0, 0.0, 0.0, 0.0
        for e in range(first[i], first[i + 1]):
            top = max(top, levels[other[e]])
        if top == 0:
            continue
        for k in range(first[i + 1] - first[i] + 1):
            e = first[i] + k - 1
            j = i if k == 0 else other[e]
            shares[k] = 0.0
            if levels[j] == 0:
                continue
            f, g, h, v = cameras[j, 0], cameras[j, 1], cameras[j, 2], cameras[j, 3]
            weight = 1.0
            if k > 0:
                a, b, c, d = measured[e, 0], measured[e, 1], measured[e, 2], measured[e, 3]
                f, g, h, v = (
                    a * f - b * g - c * h - d * v,
                    a * g + b * f + c * v - d * h,
                    a * h - b * v + c * f + d * g,
                    a * v + b * h - c * g + d * f,
                )
                weight = weights[e]
            shares[k] = math.exp(SHARPNESS * weight * levels[j] / top)
            if sides[i, 0] * f + sides[i, 1] * g + sides[i, 2] * h + sides[i, 3] * v < 0:
                shares[k] = -shares[k]
            terms[k, 0], terms[k, 1], terms[k, 2], terms[k, 3] = f, g, h, v
            p, q, r, s = p + shares[k] * f, q + shares[k] * g, r + shares[k] * h, s + shares[k] * v
        scale = 1 / math.sqrt(p * p + q * q + r * r + s * s)
        p, q, r, s = scale * p, scale * q, scale * r, scale * s
        along = p * after[i, 0] + q * after[i, 1] + r * after[i, 2] + s * after[i, 3]
        f, g = scale * (after[i, 0] - along * p), scale * (after[i, 1] - along * q)
        h, v = scale * (after[i, 2] - along * r), scale * (after[i, 3] - along * s)
        if shares[0] != 0:
            before[i, 0], before[i, 1] = before[i, 0] + shares[0] * f, before[i, 1] + shares[0] * g
            before[i, 2], before[i, 3] = before[i, 2] + shares[0] * h, before[i, 3] + shares[0] * v
        for e in range(first[i], first[i + 1]):
            k = e - first[i] + 1
            if shares[k] == 0:
                continue
            j, share = other[e], shares[k]
            product = terms[k, 0] * f + terms[k, 1] * g + terms[k, 2] * h + terms[k, 3] * v
            of_weights[e] += SHARPNESS * levels[j] / top * share * product
            a, b, c, d = share * measured[e, 0], share * measured[e, 1], share * measured[e, 2], share * measured[e, 3]
            before[j, 0] += a * f + b * g + c * h + d * v
            before[j, 1] += a * g - b * f - c * v + d * h
            before[j, 2] += a * h + b * v - c * f - d * g
            before[j, 3] += a * v - b * h + c * g - d * f
