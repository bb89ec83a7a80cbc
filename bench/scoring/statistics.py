"""How sure a figure is, and which methods cannot be told apart.

Everything here resamples cameras and seeds as if they were drawn independently from what the reader cares
about. They are not quite: the cameras of one scene share edges, sub-scenes and the gauge, so their errors are
correlated and the intervals are too narrow; a single seed says nothing of a method's luck, and a handful says
little; and one scene says nothing about another. A tie is therefore trustworthy, a difference holds for these
cameras under these seeds.
"""

import itertools
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from bench.problem import Floats

Statistic = Literal["mean", "median"]
Centre = Callable[[Floats, int], Any]  # of values along an axis
Key = TypeVar("Key", bound=Hashable)

RESAMPLES = 1000
MIN_CAMERAS = 10  # a bootstrap over fewer says nothing
MIN_COVERAGE = 0.95
PRIOR_FREEDOM = 3  # seeds
FLOOR_DEG = 1e-6  # exact recoveries are not ranked by their rounding errors
RESOLUTION = 0.005  # a ratio that printed figures would hardly show is not a difference
SMALLEST = 1e-9  # standard deviations below this are rounding
BLOCK = 4_000_000  # numbers resampled at once: 32 MB
_CENTRES: dict[Statistic, Centre] = {"mean": np.mean, "median": np.median}


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

    Returns
    -------
    tuple
        Lower and upper end; NaN where nothing was scored.
    """
    if not np.isfinite(errors).any():
        return float("nan"), float("nan")
    draws = _replicates(np.atleast_2d(errors)[None], _CENTRES[statistic], same_cameras)[:, 0]
    low, high = np.percentile(draws, [50 * (1 - level), 50 * (1 + level)])
    return float(low), float(high)


def seed_half_width(values: Sequence[float], level: float = 0.95) -> float:
    """Half-width of Student's t interval of the mean over seeds; NaN for fewer than two seeds."""
    from scipy.special import stdtrit

    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    if len(finite) < 2:
        return float("nan")
    quantile = float(stdtrit(len(finite) - 1, 0.5 + level / 2))
    return quantile * float(finite.std(ddof=1)) / float(np.sqrt(len(finite)))


def tie_groups(
    errors: Mapping[Key, Floats],
    statistics: Sequence[Statistic] = ("median", "mean"),
    *,
    same_cameras: bool = True,
    level: float = 0.05,
) -> set[Key]:
    """Methods that cannot be told apart from the best one on an instance, the best included.

    The best is the best by the first statistic. A method leaves its group where it is worse by any of them: a
    median alone is blind to the half of the cameras above it. The level is shared among the statistics.

    Methods are compared by the logarithm of a statistic, averaged over seeds, so that a hard seed weighs no
    more than an easy one. A paired bootstrap: each resample draws the same seeds and cameras for all methods.
    A method is told apart from the best when its studentized difference exceeds the 1 - `level` quantile of
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
        As in `confidence_interval`.
    level
        Probability of telling apart, anywhere in the table's row, methods that are equally good. In
        simulations it is kept by the median, while the mean of skewed errors comes to about twice the level.

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
    centres = [_log_of(_CENTRES[statistic]) for statistic in statistics]
    best = int(np.argmin(np.nanmean(_scores(table, centres[0]), axis=1)))
    apart = np.any([_told_apart(table, best, c, same_cameras, level / len(centres)) for c in centres], axis=0)
    return {key for key, told in zip(competing, apart, strict=True) if not told}


def tied(by_method: Mapping[Key, Sequence[Floats]], *, same_cameras: bool) -> set[Key]:
    """`tie_groups` of errors (n,), one array for each seed of each method.

    On one instance a deterministic method ran once, and would have done the same under every seed.
    """
    seeds = max(map(len, by_method.values()))
    repeated = {m: list(e) * (seeds if same_cameras and len(e) == 1 else 1) for m, e in by_method.items()}
    return tie_groups({m: _padded(errors) for m, errors in repeated.items()}, same_cameras=same_cameras)


def _padded(errors: Sequence[Floats]) -> Floats:
    """(seeds, cameras), with NaN where the instances of the seeds differ in size."""
    out = np.full((len(errors), max(map(len, errors))), np.nan)
    for row, e in zip(out, errors, strict=True):
        row[: len(e)] = e
    return out


def _told_apart(table: Floats, best: int, centre: Centre, same_cameras: bool, level: float) -> NDArray[np.bool_]:
    """Whether each method (axis 0 of the table) is told apart from, and worse than, the best."""
    per_seed = _scores(table, centre)
    scores = np.nanmean(per_seed, axis=1)
    draws = _replicates(table, centre, same_cameras)
    largest = np.zeros(len(draws))
    for i, j in itertools.combinations(range(len(table)), 2):
        difference = draws[:, i] - draws[:, j]
        if difference.std() > SMALLEST:
            largest = np.maximum(largest, np.abs(difference - difference.mean()) / difference.std())
    critical = float(np.quantile(largest, 1 - level))
    behind = scores - scores[best]
    by_seed = per_seed - per_seed[best]
    of_seeds, freedom = _seed_variance(np.delete(by_seed[:, np.isfinite(by_seed[0])], best, axis=0))
    several = freedom > 0
    if several:
        critical = max(critical, _bonferroni(level, len(table)))
    told = np.zeros(len(table), dtype=bool)
    for method, variance in zip(np.delete(np.arange(len(table)), best), of_seeds, strict=True):
        resampled = 0.0 if several and not same_cameras else float((draws[:, method] - draws[:, best]).var())
        cameras = int(np.isfinite(table[best]).any(axis=0).sum())
        threshold = _threshold(critical, float(variance), freedom, resampled, cameras)
        told[method] = behind[method] > max(threshold, RESOLUTION)
    return told


def _log_of(centre: Centre) -> Centre:
    return lambda values, axis: np.log(np.maximum(centre(values, axis), FLOOR_DEG))


def _bonferroni(level: float, methods: int) -> float:
    """Normal quantile for the differences of all pairs of methods."""
    from scipy.special import ndtri

    return float(-ndtri(level / (methods * (methods - 1))))


def _seed_variance(differences: Floats) -> tuple[Floats, float]:
    """Variance of the mean over seeds of differences (methods, seeds), and its degrees of freedom.

    Two or three seeds hardly know their own variance, so it is drawn towards the median over the methods, as
    if up to `PRIOR_FREEDOM` further seeds had shown that (moderated variances, Smyth 2004, where the prior is
    fitted; here it grows with the number of methods and seeds that it is taken from).
    """
    methods, seeds = differences.shape
    if seeds < 2 or methods == 0:
        return np.zeros(methods), 0.0
    variance = differences.var(axis=1, ddof=1)
    prior = min(PRIOR_FREEDOM, (seeds - 1) * (methods - 1) / 2)
    freedom = seeds - 1 + prior
    moderated = ((seeds - 1) * variance + prior * np.median(variance)) / freedom
    return moderated / seeds, freedom


def _threshold(critical: float, of_seeds: float, freedom: float, resampled: float, cameras: int) -> float:
    """Largest difference that chance explains, from the normal quantile `critical`.

    A bootstrap over few units is too narrow. As in a t test, the variance is scaled by units / (units - 1)
    and the quantile is Student's, with the degrees of freedom of Welch and Satterthwaite for a sum of two
    parts: what varies from seed to seed, and the rest of the bootstrap variance `resampled`, which varies
    from camera to camera. Where every seed has an instance of its own the seeds are the units, their
    differences hold the cameras' part already, and `resampled` is zero.
    """
    from scipy.special import ndtr, stdtrit

    of_cameras = max(resampled - of_seeds, 0.0) * cameras / (cameras - 1)
    total = of_seeds + of_cameras
    if total == 0:
        return 0.0
    combined = total**2 / (of_seeds**2 / max(freedom, 1) + of_cameras**2 / (cameras - 1))
    return float(stdtrit(combined, ndtr(critical)) * np.sqrt(total))


def _replicates(table: Floats, centre: Centre, same_cameras: bool) -> Floats:
    """(RESAMPLES, methods) scores of resampled errors (methods, seeds, cameras).

    Missing errors are missing for all methods alike. Seeds are drawn with replacement, then the cameras
    within each; the generator is fixed, so that the same errors always give the same answer.
    """
    rng = np.random.default_rng(0)
    by_seed = [errors[:, np.isfinite(errors[0])] for errors in table.transpose(1, 0, 2)]
    by_seed = [errors for errors in by_seed if errors.size]
    seeds, cameras = len(by_seed), table.shape[2]
    out = np.empty((RESAMPLES, len(table)))
    for start, stop in _blocks(max(len(table), seeds) * cameras):
        size = stop - start
        uniform = rng.random((size, 1 if same_cameras else seeds, cameras))
        of_seed = np.empty((len(table), seeds, size))
        for s, errors in enumerate(by_seed):
            count = errors.shape[1]
            picked = (uniform[:, 0 if same_cameras else s, :count] * count).astype(int)
            of_seed[:, s] = centre(errors[:, picked], 2)
        chosen = rng.integers(seeds, size=(seeds, size))
        out[start:stop] = of_seed[:, chosen, np.arange(size)].mean(axis=1).T
    return out


def _scores(table: Floats, centre: Centre) -> Floats:
    """(methods, seeds) centre over the cameras of errors (methods, seeds, cameras)."""
    scores = np.full(table.shape[:2], np.nan)
    for s in range(table.shape[1]):
        scored = np.isfinite(table[0, s])
        if scored.any():
            scores[:, s] = centre(table[:, s, scored], 1)
    return scores


def _blocks(numbers_each: int) -> Iterator[tuple[int, int]]:
    """Ranges of resamples that together need no more than `BLOCK` numbers."""
    size = max(1, BLOCK // numbers_each)
    for start in range(0, RESAMPLES, size):
        yield start, min(start + size, RESAMPLES)
