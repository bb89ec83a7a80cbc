"""Resampling errors over seeds and cameras, and how much of their spread is whose."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

import numpy as np

from bench.core.problem import Floats

Statistic = Literal["mean", "median"]
Centre = Callable[[Floats, int], Any]  # of values along an axis

RESAMPLES = 1000
PRIOR_FREEDOM = 3  # seeds
FLOOR_DEG = 1e-6  # exact recoveries are not ranked by their rounding errors
SMALLEST = 1e-9  # standard deviations below this are rounding
BLOCK = 4_000_000  # numbers resampled at once: 32 MB
CENTRES: dict[Statistic, Centre] = {"mean": np.mean, "median": np.median}


def log_of(centre: Centre) -> Centre:
    """The logarithm of a centre, in degrees, above `FLOOR_DEG`."""
    return lambda values, axis: np.log(np.maximum(centre(values, axis), FLOOR_DEG))


def padded(errors: Sequence[Floats]) -> Floats:
    """(seeds, cameras) of one array (n,) a seed, with NaN where the instances of the seeds differ in size."""
    out = np.full((len(errors), max(map(len, errors))), np.nan)
    for row, own in zip(out, errors, strict=True):
        row[: len(own)] = own
    return out


def seed_scores(table: Floats, centre: Centre) -> Floats:
    """(methods, seeds) centre over the cameras of errors (methods, seeds, cameras), NaN where there are none.

    Missing errors are missing for all methods alike.
    """
    scores = np.full(table.shape[:2], np.nan)
    for s in range(table.shape[1]):
        scored = np.isfinite(table[0, s])
        if scored.any():
            scores[:, s] = centre(table[:, s, scored], 1)
    return scores


def replicates(table: Floats, centre: Centre, same_cameras: bool) -> Floats:
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


def seed_variance(differences: Floats) -> tuple[Floats, float]:
    """Variance of the mean over seeds of differences (methods, seeds), and its degrees of freedom.

    Two or three seeds hardly know their own variance, so it is drawn towards the median over the methods, as
    if up to `PRIOR_FREEDOM` further seeds had shown that (moderated variances, Smyth 2004, where the prior is
    fitted; here it grows with the number of methods and seeds that it is taken from). Zero, with no degree of
    freedom, where there is one seed.
    """
    methods, seeds = differences.shape
    if seeds < 2 or methods == 0:
        return np.zeros(methods), 0.0
    variance = differences.var(axis=1, ddof=1)
    prior = min(PRIOR_FREEDOM, (seeds - 1) * (methods - 1) / 2)
    freedom = seeds - 1 + prior
    moderated = ((seeds - 1) * variance + prior * np.median(variance)) / freedom
    return moderated / seeds, freedom


def camera_variance(errors: Floats, draws: Floats, of_seeds: float, same_cameras: bool) -> tuple[float, float]:
    """The part of a difference's bootstrap variance that is due to the cameras, and its degrees of freedom.

    Where every seed has an instance of its own the seeds are the units, and their differences hold the cameras'
    part already: it is zero. A bootstrap over few cameras is too narrow, so that it is scaled by
    cameras / (cameras - 1), as in a t test.

    Parameters
    ----------
    errors
        (seeds, cameras) of either method, NaN where the two are not compared.
    draws
        (RESAMPLES,) resampled differences.
    of_seeds
        What `seed_variance` found.
    same_cameras
        Whether the seeds share one instance.
    """
    seeds = int(np.isfinite(errors).any(axis=1).sum())
    cameras = int(np.isfinite(errors).any(axis=0).sum())
    if cameras < 2 or (seeds > 1 and not same_cameras):
        return 0.0, 1.0
    return max(float(draws.var()) - of_seeds, 0.0) * cameras / (cameras - 1), cameras - 1.0


def combined(first: float, first_freedom: float, second: float, second_freedom: float) -> tuple[float, float]:
    """A sum of two variances and its degrees of freedom (Welch 1947, Satterthwaite 1946)."""
    total = first + second
    if total == 0:
        return 0.0, 1.0
    return total, total**2 / (first**2 / max(first_freedom, 1) + second**2 / second_freedom)


def _blocks(numbers_each: int) -> Iterator[tuple[int, int]]:
    """Ranges of resamples that together need no more than `BLOCK` numbers."""
    size = max(1, BLOCK // numbers_each)
    for start in range(0, RESAMPLES, size):
        yield start, min(start + size, RESAMPLES)
