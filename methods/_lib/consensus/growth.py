"""A solution grown camera by camera, each where most of its neighbours put it."""

import heapq
import math

import numpy as np

from bench import Floats, Ints

from ..loops.edge_kernels import compiled
from .half_edges import HalfEdges

STRONGEST = 10  # edges at a camera that take part in the growth
OWN = 0.5  # vote of a measurement for the place that it asks for itself
STEPS = 1e9  # in a vote; smaller differences are rounding, which must not decide


def grown(half: HalfEdges, weights: Floats, scale: float, root: int) -> Floats:
    """Quaternions (n, 4) of all cameras, from the identity at `root` outwards.

    Every neighbour j in place asks an outside camera i to stand at R_ij R_j. Each such place gets the votes of all
    the others, w_ij (1 + (a / s)^2)^-2 at the angle a between the two places. The camera that has the best-supported
    place comes next; it is put at the mean of the places around it, weighted by the same votes.

    Parameters
    ----------
    half
        A connected graph; of every camera only the edges of largest weight take part.
    weights
        (m,) w.
    scale
        s, radians.
    """
    half = half.strongest(weights, STRONGEST)
    cameras = np.zeros((len(half.first) - 1, 4))
    votes = weights[half.ids] / weights.max()
    _grow(half.ranks, half.first, half.others, half.quaternions, votes, math.sin(scale / 2) ** 2, root, cameras)
    return cameras


@compiled
def _grow(
    ranks: Ints,
    first: Ints,
    others: Ints,
    quaternions: Floats,
    votes: Floats,
    scale: float,
    root: int,
    cameras: Floats,
) -> None:
    """Fill `cameras` (n, 4).

    Parameters
    ----------
    ranks, first, others, quaternions
        See `HalfEdges`.
    votes
        (2m,) of each half edge.
    scale
        Squared sine of half the angle s.
    """
    n = len(first) - 1
    places, asked, support = np.zeros((len(others), 4)), np.zeros(len(others)), np.zeros(len(others))
    counts, best, place = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    inside, ranked = np.zeros(n, dtype=np.bool_), np.argsort(ranks)
    heap = [(np.int64(0), np.int64(0))]
    heap.pop()
    cameras[root, 0] = 1.0
    new = np.int64(root)
    while new >= 0:
        inside[new] = True
        d, e, f, g = cameras[new, 0], cameras[new, 1], cameras[new, 2], cameras[new, 3]
        for h in range(first[new], first[new + 1]):
            i = others[h]
            if inside[i]:
                continue
            w, x, y, z = quaternions[h, 0], -quaternions[h, 1], -quaternions[h, 2], -quaternions[h, 3]
            p = w * d - x * e - y * f - z * g
            q = w * e + x * d + y * g - z * f
            r = w * f - x * g + y * d + z * e
            s = w * g + x * f - y * e + z * d
            own = first[i] + counts[i]
            before, total = best[i], OWN * votes[h]
            for a in range(first[i], own):
                cosine = p * places[a, 0] + q * places[a, 1] + r * places[a, 2] + s * places[a, 3]
                share = 1 / (1 + max(1 - cosine * cosine, 0.0) / scale)
                share *= share
                support[a] += votes[h] * share
                total += asked[a] * share
                if math.floor(support[a] * STEPS + 0.5) > best[i]:
                    best[i], place[i] = math.floor(support[a] * STEPS + 0.5), a
            places[own, 0], places[own, 1], places[own, 2], places[own, 3] = p, q, r, s
            asked[own], support[own] = votes[h], total
            counts[i] += 1
            if math.floor(total * STEPS + 0.5) > best[i]:
                best[i], place[i] = math.floor(total * STEPS + 0.5), own
            if best[i] > before:
                heapq.heappush(heap, (-best[i], np.int64(ranks[i])))
        new = np.int64(-1)
        while len(heap) > 0 and new < 0:
            vote, rank = heapq.heappop(heap)
            i = ranked[rank]
            if not inside[i] and -vote == best[i]:
                new = i
        if new < 0:
            return
        p, q, r, s = 0.0, 0.0, 0.0, 0.0
        at = place[new]
        for a in range(first[new], first[new] + counts[new]):
            cosine = 0.0
            for k in range(4):
                cosine += places[a, k] * places[at, k]
            share = 1 / (1 + max(1 - cosine * cosine, 0.0) / scale)
            share *= share * asked[a]
            if cosine < 0:
                share = -share
            p, q = p + share * places[a, 0], q + share * places[a, 1]
            r, s = r + share * places[a, 2], s + share * places[a, 3]
        norm = math.sqrt(p * p + q * q + r * r + s * s)
        cameras[new, 0], cameras[new, 1], cameras[new, 2], cameras[new, 3] = p / norm, q / norm, r / norm, s / norm
