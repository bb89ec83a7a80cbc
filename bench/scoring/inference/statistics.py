"""How sure a figure is, and which methods cannot be told apart.

Everything here resamples cameras and seeds as if they were drawn independently from what the reader cares
about. They are not quite: the cameras of one scene share edges, sub-scenes and the gauge, so their errors are
correlated and the intervals are too narrow; a single seed says nothing of a method's luck, and a handful says
little; and one scene says nothing about another. A tie is therefore trustworthy, a difference holds for these
cameras under these seeds.
"""

import itertools
from collections.abc import Hashable, Mapping, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bench.core.problem import Floats
from bench.scoring.inference.difference import LEVEL
from bench.scoring.inference.resampling import (
    CENTRES,
    SMALLEST,
    Centre,
    Statistic,
    camera_variance,
    combined,
    log_of,
    padded,
    replicates,
    seed_scores,
    seed_variance,
)

Key = TypeVar("Key", bound=Hashable)

MIN_CAMERAS = 10  # a bootstrap over fewer says nothing
MIN_COVERAGE = 0.95
RESOLUTION = 0.005  # a ratio that printed figures would hardly show is not a difference


def confidence_interval(errors: Floats, statistic: Statistic = "median") -> tuple[float, float]:
    """Ends of the 95 % percentile bootstrap interval of a statistic of errors (k,); NaN where nothing was scored."""
    if not np.isfinite(errors).any():
        return float("nan"), float("nan")
    low, high = np.percentile(replicates(errors[None, None], CENTRES[statistic], True)[:, 0], [2.5, 97.5])
    return float(low), float(high)


def seed_half_width(values: Sequence[float]) -> float:
    """Half-width of Student's 95 % t interval of the mean over seeds; NaN for fewer than two seeds."""
    from scipy.special import stdtrit

    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    if len(finite) < 2:
        return float("nan")
    quantile = float(stdtrit(len(finite) - 1, 1 - LEVEL / 2))
    return quantile * float(finite.std(ddof=1)) / float(np.sqrt(len(finite)))


def tie_groups(
    errors: Mapping[Key, Floats],
    statistics: Sequence[Statistic] = ("median", "mean"),
    *,
    same_cameras: bool = True,
) -> set[Key]:
    """Methods that cannot be told apart from the best one on an instance, the best included.

    The best is the best by the first statistic. A method leaves its group where it is worse by any of them: a
    median alone is blind to the half of the cameras above it. `LEVEL` is shared among the statistics: the probability
    of telling apart, anywhere in the table's row, methods that are equally good. In simulations it is kept by the
    median, while the mean of skewed errors comes to about twice the level.

    Methods are compared by the logarithm of a statistic, averaged over seeds, so that a hard seed weighs no
    more than an easy one. A paired bootstrap: each resample draws the same seeds and cameras for all methods.
    A method is told apart from the best when its studentized difference exceeds the 1 - `LEVEL` quantile of
    the largest studentized difference between *any* two methods in the centred bootstrap distribution
    (single-step max-t, Romano and Wolf 2005). Taking all pairs pays both for the number of comparisons and
    for having picked the best by looking. Where there are several seeds the quantile is at least
    Bonferroni's, because resamples of two or three seeds are bounded.

    Parameters
    ----------
    errors
        For each method (k,) or (s, k) errors in degrees on the same k cameras and s seeds, NaN where not
        scored. Methods that failed altogether are left out or all NaN.
    statistics
        What is compared.
    same_cameras
        True where the seeds share one instance: a camera drawn is then drawn under every seed (the pigeonhole
        bootstrap of Owen 2007, which errs on the wide side). False where the instance changes with the seed.

    Returns
    -------
    set
        Only methods that scored at least 95 % as many cameras as the most complete one compete; leaving out
        the hard cameras must not win. They are compared on the cameras that all of them scored. All of them
        tie where these are fewer than `MIN_CAMERAS`. Errors below `FLOOR_DEG`, and errors within a ratio of
        1 + `RESOLUTION`, are ties. Empty where nothing was scored.
    """
    stacked = {key: np.atleast_2d(value) for key, value in errors.items()}
    counts = {key: int(np.isfinite(value).sum()) for key, value in stacked.items()}
    most = max(counts.values(), default=0)
    competing = [key for key, count in counts.items() if count > 0 and count >= MIN_COVERAGE * most]
    if not competing:
        return set()
    table = np.stack([stacked[key] for key in competing])
    table = np.where(np.isfinite(table).all(axis=0), table, np.nan)
    if np.isfinite(table[0]).sum(axis=1).max() < MIN_CAMERAS:
        return set(competing)
    centres = [log_of(CENTRES[statistic]) for statistic in statistics]
    best = int(np.argmin(np.nanmean(seed_scores(table, centres[0]), axis=1)))
    apart = np.any([_told_apart(table, best, c, same_cameras, LEVEL / len(centres)) for c in centres], axis=0)
    return {key for key, told in zip(competing, apart, strict=True) if not told}


def tied(by_method: Mapping[Key, Sequence[Floats]], *, same_cameras: bool) -> set[Key]:
    """`tie_groups` of errors (n,), one array for each seed of each method.

    On one instance a deterministic method ran once, and would have done the same under every seed.
    """
    seeds = max(map(len, by_method.values()))
    repeated = {m: list(e) * (seeds if same_cameras and len(e) == 1 else 1) for m, e in by_method.items()}
    return tie_groups({m: padded(errors) for m, errors in repeated.items()}, same_cameras=same_cameras)


def _told_apart(table: Floats, best: int, centre: Centre, same_cameras: bool, level: float) -> NDArray[np.bool_]:
    """Whether each method (axis 0 of the table) is told apart from, and worse than, the best."""
    per_seed = seed_scores(table, centre)
    behind = np.nanmean(per_seed, axis=1) - np.nanmean(per_seed[best])
    draws = replicates(table, centre, same_cameras)
    critical = _largest_by_chance(draws, level)
    by_seed = per_seed - per_seed[best]
    others = np.delete(np.arange(len(table)), best)
    of_seeds, freedom = seed_variance(by_seed[others][:, np.isfinite(by_seed[best])])
    if freedom > 0:
        critical = max(critical, _bonferroni(level, len(table)))
    told = np.zeros(len(table), dtype=bool)
    for method, variance in zip(others, of_seeds, strict=True):
        of_cameras = camera_variance(table[best], draws[:, method] - draws[:, best], variance, same_cameras)
        threshold = _threshold(critical, *combined(variance, freedom, *of_cameras))
        told[method] = behind[method] > max(threshold, RESOLUTION)
    return told


def _largest_by_chance(draws: Floats, level: float) -> float:
    """The 1 - level quantile of the largest studentized difference between any two methods."""
    largest = np.zeros(len(draws))
    for i, j in itertools.combinations(range(draws.shape[1]), 2):
        difference = draws[:, i] - draws[:, j]
        if difference.std() > SMALLEST:
            largest = np.maximum(largest, np.abs(difference - difference.mean()) / difference.std())
    return float(np.quantile(largest, 1 - level))


def _bonferroni(level: float, methods: int) -> float:
    """Normal quantile for the differences of all pairs of methods."""
    from scipy.special import ndtri

    return float(-ndtri(level / (methods * (methods - 1))))


def _threshold(critical: float, variance: float, freedom: float) -> float:
    """Largest difference that chance explains, from the normal quantile `critical`: Student's takes its place."""
    from scipy.special import ndtr, stdtrit

    return float(stdtrit(freedom, float(ndtr(critical))) * np.sqrt(variance)) if variance > 0 else 0.0
