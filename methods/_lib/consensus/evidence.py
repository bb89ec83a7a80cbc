"""What the triangles say: how noisy the measurements are, and how many triangles vouch for each edge."""

import math

import numpy as np

from bench import Floats, Ints

from ..loops.edge_kernels import compiled
from .half_edges import HalfEdges

BUDGET = 8_000_000  # triangles looked at
FEWEST, SAMPLE = 16, 8  # triangles over an edge: at least, where there are; and those that tell the noise
MOST_SCALES = 4  # a number that the compiler knows, so that it takes them at once
BINS = 3600  # of the histogram of angles, up to 180 degrees
QUANTILE, FACTOR = 0.02, 2.0
NARROWEST, WIDEST, UNKNOWN = np.radians([0.2, 6.0, 5.0])
INNER, OUTER = 3.0, 6.0  # sigma
FIFTH = 1.005  # sigma, below which a fifth of normal vectors in three dimensions are
NORMAL, FEWEST_INNER = 0.1, 100  # of the angles up to three sigma, at most so many are between three and six
ROUNDS, SETTLED = 50, 1e-3  # of finding sigma


def closing_angles(half: HalfEdges, m: int) -> Ints:
    """Histogram (BINS,), up to 180 degrees, of the angles by which triangles do not close: up to 8 over each edge."""
    histogram = np.zeros(BINS, dtype=np.int32)
    _visit(half, SAMPLE, np.zeros(0), np.zeros((0, MOST_SCALES)), histogram)
    return histogram


def triangles_over_edges(half: HalfEdges, m: int, histogram: Ints) -> float:
    """How many triangles of that histogram are over an edge, on average."""
    each = 3 if _whole(half, SAMPLE) else 1  # edges that a triangle was counted for at once
    return each * float(histogram.sum()) / m


def noise_scale(histogram: Ints) -> float:
    """Scale in radians at which good triangles close: twice the 2 % quantile of `closing_angles`.

    So low a quantile is that of good triangles even where most edges are wrong. Limited to 0.2 and 6 degrees; 5 where
    the graph has no triangle.
    """
    if not histogram.any():
        return float(UNKNOWN)
    cumulated = np.cumsum(histogram)
    place = np.interp(QUANTILE * cumulated[-1], np.concatenate([[0], cumulated]), np.arange(BINS + 1))
    return float(np.clip(FACTOR * place * np.pi / BINS, NARROWEST, WIDEST))


def errors_are_normal(histogram: Ints) -> bool:
    """Whether triangles of that histogram close as those of independent normal errors do, or do not close at all.

    Sigma is such that of the angles below three sigma a fifth is as small as it would be of normal errors, which
    wrong triangles hardly change. Of normal ones 3 % are then between three and six sigma, up to 10 % with 30 % of the
    edges wrong; between photographs, some of which err much more than others, a quarter and more.
    """
    cumulated = np.concatenate([[0], np.cumsum(histogram)])
    places = np.arange(BINS + 1)

    def below(place: float) -> float:
        return float(np.interp(place, places, cumulated))

    sigma = BINS / INNER
    for _ in range(ROUNDS):
        before, sigma = sigma, float(np.interp(below(INNER * sigma) / 5, cumulated, places)) / FIFTH
        if abs(sigma - before) < SETTLED * before:
            break
    inner = below(INNER * sigma)
    return inner >= FEWEST_INNER and below(OUTER * sigma) - inner < NORMAL * inner


def support_by_triangles(half: HalfEdges, m: int, scales: Floats) -> Floats:
    """(k, m) sum over the triangles at each edge of (1 + (c / s)^2)^-2, where c = 4 sin(a / 4).

    a is the angle of R_ij R_jl R_li, and c is the same up to 1 % at 60 degrees, without an arcsine. Where there are too
    many triangles, each edge has as many as the budget allows, those with the cameras of highest rank.

    Parameters
    ----------
    scales
        (k,) values of s, radians; at most four.
    """
    support = np.zeros((m, MOST_SCALES))
    _visit(half, max(FEWEST, BUDGET // m), scales, support, np.zeros(0, dtype=np.int32))
    return np.ascontiguousarray(support[:, : len(scales)].T)


def _visit(half: HalfEdges, most: int, scales: Floats, support: Floats, histogram: Ints) -> None:
    """Visit up to `most` triangles over each edge; see `_visit_triangles`."""
    whole, inverse = _whole(half, most), np.zeros(MOST_SCALES)
    inverse[: len(scales)] = 1 / scales**2
    _visit_triangles(
        half.ranks, half.first, half.others, half.ids, half.quaternions, most, whole, inverse, support, histogram
    )


def _whole(half: HalfEdges, most: int) -> bool:
    return bool(most >= np.diff(half.first).max())


@compiled
def _visit_triangles(
    ranks: Ints,
    first: Ints,
    others: Ints,
    ids: Ints,
    quaternions: Floats,
    most: int,
    whole: bool,
    inverse: Floats,
    support: Floats,
    histogram: Ints,
) -> None:
    """Visit up to `most` triangles over each edge; where these are all, every triangle once.

    Parameters
    ----------
    ranks, first, others, ids, quaternions
        See `HalfEdges`.
    whole
        Whether every edge has at most so many: a triangle then counts for its three edges when that between the two
        cameras of highest rank is visited, and otherwise for the visited edge alone.
    inverse, support
        (4,) s^-2, and (m, 4) what triangles that close at each scale s add to; none where m is zero.
    histogram
        (b,) what their angles add to, bins of equal width up to pi; none where b is zero.
    """
    n, bins, vouching = len(first) - 1, len(histogram), len(support) > 0
    place = np.full(n, -1, dtype=np.int32)
    own = np.zeros(MOST_SCALES)
    for i in range(n):
        for a in range(first[i], first[i + 1]):
            place[others[a]] = a
        for a in range(first[i], first[i + 1]):
            j = others[a]
            longer = first[j + 1] - first[j] - first[i + 1] + first[i]
            if longer > 0 or (longer == 0 and j > i):
                continue
            w, x, y, z = quaternions[a, 0], quaternions[a, 1], quaternions[a, 2], quaternions[a, 3]
            last, count = max(ranks[i], ranks[j]), 0
            own[:] = 0
            for step in range(first[j + 1] - first[j]):
                b = first[j + 1] - 1 - step if whole else first[j] + step
                if whole and ranks[others[b]] < last:
                    break
                c = place[others[b]]
                if c < 0:
                    continue
                d, e, f, g = quaternions[b, 0], quaternions[b, 1], quaternions[b, 2], quaternions[b, 3]
                p = w * d - x * e - y * f - z * g
                q = w * e + x * d + y * g - z * f
                r = w * f - x * g + y * d + z * e
                s = w * g + x * f - y * e + z * d
                d, e, f, g = quaternions[c, 0], quaternions[c, 1], quaternions[c, 2], quaternions[c, 3]
                square = 8 * max(1 - abs(p * d + q * e + r * f + s * g), 0.0)
                if bins > 0:
                    angle = 4 * math.asin(math.sqrt(square) / 4)
                    histogram[min(int(angle / math.pi * bins), bins - 1)] += 1
                if vouching:
                    second, third = ids[b], ids[c]
                    for k in range(MOST_SCALES):
                        share = 1 / (1 + square * inverse[k])
                        share *= share
                        own[k] += share
                        if whole:
                            support[second, k] += share
                            support[third, k] += share
                count += 1
                if count == most and not whole:
                    break
            if vouching:
                for k in range(MOST_SCALES):
                    support[ids[a], k] += own[k]
        for a in range(first[i], first[i + 1]):
            place[others[a]] = -1
