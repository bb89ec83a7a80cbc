"""How sure a figure is, and which methods cannot be told apart.

Everything here resamples cameras and seeds as if they were drawn independently from what the reader cares
about. They are not quite: the cameras of one scene share edges, sub-scenes and the gauge, so their errors are
correlated and the intervals are too narrow; a handful of seeds says little about the spread over seeds; and
one scene says nothing about another. A tie is therefore trustworthy, a difference holds for these cameras
under these seeds.
"""

import itertools
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Literal, TypeVar

import numpy as np

from bench.problem import Floats

Statistic = Literal["mean", "median"]
Key = TypeVar("Key", bound=Hashable)

RESAMPLES = 1000
MIN_CAMERAS = 10  # a bootstrap over fewer says nothing
MIN_COVERAGE = 0.95
RESOLUTION_DEG = 1e-6  # exact recoveries are not ranked by their rounding errors
BLOCK = 4_000_000  # numbers resampled at once: 32 MB


def confidence_interval(
    errors: Floats, statistic: Statistic = "median", *, same_cameras: bool = True, level: float = 0.95
) -> tuple[float, float]:
    """Percentile bootstrap interval of one method's error on one instance.

    Parameters
    ----------
    errors
        (k,) or (s, k) errors of k cameras under s seeds, NaN where not scored.
    statistic
        Taken over the cameras of each seed, then averaged over seeds.
    same_cameras
        True where the seeds share one instance: a camera drawn is then drawn under every seed (the pigeonhole
        bootstrap of Owen 2007, which errs on the wide side). False where the instance changes with the seed.
    level
        Coverage aimed at.
    """
    draws = _replicates(np.atleast_2d(errors)[None], statistic, same_cameras)[:, 0]
    low, high = np.nanpercentile(draws, [50 * (1 - level), 50 * (1 + level)])
    return float(low), float(high)


def seed_half_width(values: Sequence[float], level: float = 0.95) -> float:
    """Half-width of Student's t interval of the mean over seeds; NaN for fewer than two seeds."""
    from scipy.special import stdtrit

    finite = np.array([v for v in values if np.isfinite(v)])
    if len(finite) < 2:
        return float("nan")
    quantile = float(stdtrit(len(finite) - 1, 0.5 + level / 2))
    return quantile * float(finite.std(ddof=1)) / float(np.sqrt(len(finite)))


def tie_groups(
    errors: Mapping[Key, Floats],
    statistic: Statistic = "median",
    *,
    same_cameras: bool = True,
    level: float = 0.05,
) -> set[Key]:
    """Methods that cannot be told apart from the best one on an instance, the best included.

    A paired bootstrap: each resample draws the same seeds and cameras for all methods. A method is told apart
    from the best when its studentized difference exceeds the 1 - `level` quantile of the largest studentized
    difference between *any* two methods in the centred bootstrap distribution (single-step max-t, Romano and
    Wolf 2005). Taking all pairs pays both for the number of comparisons and for having picked the best by
    looking.

    Parameters
    ----------
    errors
        For each method (k,) or (s, k) errors in degrees on the same k cameras and s seeds, NaN where not
        scored. Methods that failed altogether are left out or all NaN.
    statistic, same_cameras
        As in `confidence_interval`.
    level
        Probability of telling apart, anywhere in the table's row, methods that are equally good.

    Returns
    -------
    set
        Only methods that scored at least 95 % as many cameras as the most complete one compete; leaving out
        the hard cameras must not win. They are compared on the cameras that all of them scored. All of them
        tie where these are fewer than `MIN_CAMERAS`, and differences below `RESOLUTION_DEG` are ties. Empty
        where nothing was scored.
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
    apart = _told_apart(table, statistic, same_cameras, level)
    return {key for key, told in zip(competing, apart, strict=True) if not told}


def _told_apart(table: Floats, statistic: Statistic, same_cameras: bool, level: float) -> Sequence[bool]:
    """Whether each method (axis 0 of the table) is told apart from the best."""
    per_seed = _scores(table, statistic)
    scores = _mean_over_seeds(per_seed, axis=1)
    draws = _replicates(table, statistic, same_cameras)
    largest = np.zeros(len(draws))
    for i, j in itertools.combinations(range(len(table)), 2):
        difference = draws[:, i] - draws[:, j]
        if difference.std() > RESOLUTION_DEG:
            largest = np.maximum(largest, np.abs(difference - difference.mean()) / difference.std())
    critical = float(np.quantile(largest, 1 - level))
    best = int(np.argmin(scores))
    cameras = int(np.isfinite(table[best]).any(axis=0).sum())
    told = []
    for method, score in enumerate(scores):
        variance = float((draws[:, method] - draws[:, best]).var())
        threshold = _small_sample(critical, variance, per_seed[method] - per_seed[best], cameras)
        told.append(score - scores[best] > max(threshold, RESOLUTION_DEG))
    return told


def _small_sample(critical: float, variance: float, by_seed: Floats, cameras: int) -> float:
    """Largest difference that chance explains, from the normal quantile `critical` and a bootstrap variance.

    A bootstrap over few units is too narrow. As in a t test, the variance is scaled by units / (units - 1)
    and the quantile is Student's, with the degrees of freedom of Welch and Satterthwaite for a sum of two
    parts: what varies from seed to seed (`by_seed`, the difference under each seed) and what varies from
    camera to camera.
    """
    from scipy.special import ndtr, stdtrit

    by_seed = by_seed[np.isfinite(by_seed)]
    seeds = len(by_seed)
    of_seeds = float(by_seed.var(ddof=1)) / seeds if seeds > 1 else 0.0
    of_cameras = max(variance - of_seeds * (seeds - 1) / seeds, 0.0) * cameras / (cameras - 1)
    total = of_seeds + of_cameras
    if total == 0:
        return 0.0
    freedom = total**2 / (of_seeds**2 / max(seeds - 1, 1) + of_cameras**2 / (cameras - 1))
    return float(stdtrit(freedom, ndtr(critical)) * np.sqrt(total))


def _replicates(table: Floats, statistic: Statistic, same_cameras: bool) -> Floats:
    """(RESAMPLES, methods) scores of resampled errors (methods, seeds, cameras).

    Seeds are drawn with replacement, then the cameras within each; the generator is fixed, so that the same
    errors always give the same answer.
    """
    rng = np.random.default_rng(0)
    methods, seeds, cameras = table.shape
    scored = [np.flatnonzero(np.isfinite(table[:, s]).any(axis=0)) for s in range(seeds)]
    out = np.empty((RESAMPLES, methods))
    for start, stop in _blocks(methods * cameras):
        size = stop - start
        uniform = rng.random((size, 1 if same_cameras else seeds, cameras))
        of_seed = np.full((methods, seeds, size), np.nan)
        for s, ids in enumerate(scored):
            if len(ids):
                picked = ids[(uniform[:, 0 if same_cameras else s, : len(ids)] * len(ids)).astype(int)]
                of_seed[:, s] = _centre(table[:, s][:, picked], statistic, axis=2)
        chosen = rng.integers(seeds, size=(seeds, size))
        out[start:stop] = _mean_over_seeds(of_seed[:, chosen, np.arange(size)], axis=1).T
    return out


def _scores(table: Floats, statistic: Statistic) -> Floats:
    """(methods, seeds) statistic over the cameras of errors (methods, seeds, cameras)."""
    scores = np.full(table.shape[:2], np.nan)
    some = np.isfinite(table).any(axis=2)
    scores[some] = _centre(table[some], statistic, axis=1)
    return scores


def _centre(values: Floats, statistic: Statistic, axis: int) -> Floats:
    if np.isfinite(values).all():
        return np.asarray((np.mean if statistic == "mean" else np.median)(values, axis=axis))
    return np.asarray((np.nanmean if statistic == "mean" else np.nanmedian)(values, axis=axis))


def _mean_over_seeds(values: Floats, axis: int) -> Floats:
    """Mean of what is finite; NaN, without a warning, where nothing is."""
    finite = np.isfinite(values)
    count = finite.sum(axis=axis)
    total = np.where(finite, values, 0).sum(axis=axis)
    mean: Floats = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
    return mean


def _blocks(numbers_each: int) -> Iterator[tuple[int, int]]:
    """Ranges of resamples that together need no more than `BLOCK` numbers."""
    size = max(1, BLOCK // numbers_each)
    for start in range(0, RESAMPLES, size):
        yield start, min(start + size, RESAMPLES)
