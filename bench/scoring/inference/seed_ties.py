"""Which methods cannot be told apart, where so many seeds were run that their statistics alone can tell.

With hundreds of seeds, each an instance of its own, the seeds are the units: what varies from camera to camera is in
their statistics already, and resampling a million arrays of errors would show nothing more.
"""

from collections.abc import Hashable, Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bench.core.problem import Floats
from bench.scoring.inference.difference import LEVEL
from bench.scoring.inference.resampling import FLOOR_DEG, SMALLEST
from bench.scoring.inference.statistics import MIN_COVERAGE, RESOLUTION

Key = TypeVar("Key", bound=Hashable)

MANY_SEEDS = 200
DRAWS = 20_000


def tied_by_seed(rows: Mapping[Key, Floats]) -> set[Key]:
    """Methods that cannot be told apart from the best one, the best included.

    The rules are those of `bench.scoring.inference.statistics.tie_groups`, which resamples; here the differences of the
    mean logarithms are taken as normal, with the covariance that the seeds show, and the largest studentized
    difference between any two methods is drawn from that. Median and mean share `LEVEL` too.

    Parameters
    ----------
    rows
        For each method (s, 4): seed, median and mean error in degrees (NaN where it did not end well), and how many
        cameras were scored. The best is the best by the median; methods that scored less than 95 % of the cameras of
        the most complete one are out, and only seeds that ended well for all others count.
    """
    scored = {key: of_method[:, 3].sum() for key, of_method in rows.items()}
    most = max(scored.values(), default=0)
    competing = [key for key, count in scored.items() if count > 0 and count >= MIN_COVERAGE * most]
    if not competing:
        return set()
    seeds = np.unique(np.concatenate([rows[key][:, 0] for key in competing]))
    errors = np.full((len(competing), 2, len(seeds)), np.nan)
    for k, key in enumerate(competing):
        errors[k][:, np.searchsorted(seeds, rows[key][:, 0])] = rows[key][:, 1:3].T
    logs = np.log(np.maximum(errors[:, :, np.isfinite(errors).all(axis=(0, 1))], FLOOR_DEG))
    if logs.shape[2] < 2:
        return set(competing)
    best = int(np.argmin(logs[:, 0].mean(axis=1)))
    apart = _told_apart(logs[:, 0], best) | _told_apart(logs[:, 1], best)
    return {key for key, told in zip(competing, apart, strict=True) if not told}


def _told_apart(logs: Floats, best: int) -> NDArray[np.bool_]:
    """Whether each method of logs (methods, seeds) is worse than the best by more than chance explains."""
    methods, seeds = logs.shape
    covariance = np.atleast_2d(np.cov(logs)) / seeds
    draws = np.random.default_rng(0).multivariate_normal(np.zeros(methods), covariance, DRAWS, method="eigh")
    variance = covariance.diagonal()[:, None] + covariance.diagonal() - 2 * covariance
    error = np.sqrt(np.maximum(variance, 0))
    largest = np.zeros(DRAWS)
    for i in range(methods):
        for j in range(i):
            if error[i, j] > SMALLEST:
                largest = np.maximum(largest, np.abs(draws[:, i] - draws[:, j]) / error[i, j])
    critical = float(np.quantile(largest, 1 - LEVEL / 2))
    behind = logs.mean(axis=1) - logs[best].mean()
    told: NDArray[np.bool_] = behind > np.maximum(critical * error[best], RESOLUTION)
    return told
