"""Who comes first over many problems, and how sure that is: ranks, their probabilities, Friedman and post-hoc tests."""

from dataclasses import dataclass

import numpy as np

from bench.core.problem import Floats
from bench.scoring.inference.blocks import Blocks, Configured
from bench.scoring.inference.difference import LEVEL

RESAMPLES = 2000


def ranks(values: Floats) -> Floats:
    """(b, k) ranks of k methods on each of b problems, 1 the best; methods that tie share the mean of their ranks."""
    from scipy.stats import rankdata

    return np.asarray(rankdata(values, axis=1))


def mean_ranks(blocks: Blocks) -> Floats:
    """(k,) mean rank of each method: over the problems of a scene, then over the scenes; NaN without problems."""
    if not len(blocks.values):
        return np.full(len(blocks.methods), np.nan)
    found: Floats = blocks.weights @ ranks(blocks.values)
    return found


def rank_probabilities(blocks: Blocks) -> Floats:
    """(k, k) probability that a method (row) comes first, second and so on (column), by a bootstrap over problems.

    Each resample draws scenes with replacement and, within each, its problems (where seeds made several), and orders
    the methods by their mean rank over what was drawn. Methods that tie share the places they take. As with every
    bootstrap, three scenes hardly know how scenes differ: near-certainty from few means little.
    """
    from scipy.stats import rankdata

    rng = np.random.default_rng(0)
    own, scene_of = ranks(blocks.values), np.asarray(blocks.scenes)
    by_scene = [own[scene_of == scene] for scene in np.unique(scene_of)]
    count = len(blocks.methods)
    drawn = np.zeros((RESAMPLES, count))
    for total in drawn:
        for scene in rng.integers(len(by_scene), size=len(by_scene)):
            members = by_scene[scene]
            total += members[rng.integers(len(members), size=len(members))].mean(axis=0)
    drawn = drawn.round(9)
    low, high = (rankdata(drawn, method=how, axis=1)[..., None] for how in ("min", "max"))
    place = np.arange(1, count + 1)
    inside = (low <= place) & (place <= high)
    return np.asarray((inside / inside.sum(axis=2, keepdims=True)).mean(axis=0))


@dataclass(frozen=True, eq=False)
class CriticalDifference:
    """Mean ranks and which of them cannot be told apart (Demsar, JMLR 7, 2006).

    Parameters
    ----------
    methods
        (k,) by mean rank, the best first.
    mean_ranks
        (k,) see `mean_ranks`.
    friedman_p
        P value of Friedman's test that all methods are equally good.
    critical_difference
        Of mean ranks, by Nemenyi's test.
    groups
        First and last position of each longest run of methods of which no two are told apart.
    """

    methods: tuple[Configured, ...]
    mean_ranks: Floats
    friedman_p: float
    critical_difference: float
    groups: tuple[tuple[int, int], ...]


def critical_difference(blocks: Blocks) -> CriticalDifference:
    """Friedman's test and, where it finds a difference, Nemenyi's of each pair; at least two methods and problems.

    Nemenyi's test compares mean ranks with the studentized range and so depends on which other methods take part. Mean
    ranks in which problems weigh differently vary as if they were of fewer: of ``1 / sum(weights^2)`` (Kish 1965).
    """
    from scipy.stats import studentized_range

    mean = mean_ranks(blocks)
    order = np.argsort(mean, kind="stable")
    mean, own = mean[order], ranks(blocks.values)[:, order]
    methods, problems = len(mean), 1 / float((blocks.weights**2).sum())
    friedman = friedman_p(own, blocks.weights)
    error = float(np.sqrt(methods * (methods + 1) / (12 * problems)))
    difference = float(studentized_range.ppf(1 - LEVEL, methods, np.inf)) * error
    apart = np.abs(mean[:, None] - mean) > difference if friedman < LEVEL else np.zeros((methods, methods), dtype=bool)
    return CriticalDifference(
        methods=tuple(blocks.methods[k] for k in order),
        mean_ranks=mean,
        friedman_p=friedman,
        critical_difference=difference,
        groups=tuple(_runs(~apart)),
    )


def friedman_p(own: Floats, weights: Floats) -> float:
    """P value of Friedman's test in the form of Iman and Davenport (1980).

    Parameters
    ----------
    own
        (b, k) ranks, with ties.
    weights
        (b,) shares of the problems, which sum to one.
    """
    from scipy.special import fdtrc

    methods = own.shape[1]
    problems = 1 / float((weights**2).sum())
    between = problems * ((weights @ own - (methods + 1) / 2) ** 2).sum()
    within = (weights @ (own - (methods + 1) / 2) ** 2).sum() / (methods - 1)
    if within == 0:
        return 1.0
    chi = between / within
    left = problems * (methods - 1) - chi
    if left <= 1e-9:
        return 0.0
    return float(fdtrc(methods - 1, (methods - 1) * (problems - 1), (problems - 1) * chi / left))


def _runs(together: "np.ndarray[tuple[int, int], np.dtype[np.bool_]]") -> list[tuple[int, int]]:
    """Longest runs of two or more neighbours of which all pairs are together."""
    found: list[tuple[int, int]] = []
    for first in range(len(together)):
        last = first
        while last + 1 < len(together) and together[first : last + 2, first : last + 2].all():
            last += 1
        if last > first and (not found or last > found[-1][1]):
            found.append((first, last))
    return found
