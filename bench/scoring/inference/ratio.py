"""How many times larger one method's error is than another's, with its interval and p value.

Ratios are averaged as logarithms, so that a hard problem weighs no more than an easy one and a ratio of a half
undoes one of two.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench.core.problem import Floats
from bench.scoring.inference.difference import LEVEL, Difference, judged, paired, unpaired
from bench.scoring.inference.resampling import (
    CENTRES,
    Statistic,
    camera_variance,
    combined,
    log_of,
    replicates,
    seed_scores,
    seed_variance,
)
from bench.scoring.inference.statistics import MIN_CAMERAS

Verdict = Literal["better", "worse", "cannot tell"]


@dataclass(frozen=True)
class Ratio:
    """A ratio, new to old.

    Parameters
    ----------
    value, low, high
        The estimate and its 95 % interval; the interval is NaN where there is too little to say.
    p_value
        Two-sided, of the ratio being one; NaN likewise.
    """

    value: float
    low: float = float("nan")
    high: float = float("nan")
    p_value: float = float("nan")

    def verdict(self, p_value: float, threshold: float) -> Verdict:
        """What is said of the ratio, larger being worse.

        Parameters
        ----------
        p_value
            Corrected for the number of ratios that are judged together.
        threshold
            A ratio between 1 / threshold and threshold is neither better nor worse.
        """
        if not p_value < LEVEL or 1 / threshold <= self.value <= threshold:
            return "cannot tell"
        return "worse" if self.value > 1 else "better"


def error_ratio(new: Floats, old: Floats, statistic: Statistic, *, same_cameras: bool) -> Ratio:
    """Ratio of the errors of two methods on one problem, or on the same problem of every seed.

    A paired bootstrap over cameras and Student's t over seeds, as in `bench.scoring.inference.statistics.tie_groups`.

    Parameters
    ----------
    new, old
        (s, k) errors in degrees of the same k cameras under the same s seeds, NaN where not scored. Only cameras that
        both have scored are compared.
    statistic
        Taken over the cameras of each seed; its logarithm is averaged over seeds.
    same_cameras
        Whether the seeds share one instance.
    """
    table = np.stack([np.atleast_2d(new), np.atleast_2d(old)])
    table = np.where(np.isfinite(table).all(axis=0), table, np.nan)
    if not np.isfinite(table).any():
        return Ratio(float("nan"))
    centre = log_of(CENTRES[statistic])
    by_seed = -np.diff(seed_scores(table, centre), axis=0)
    by_seed = by_seed[:, np.isfinite(by_seed[0])]
    mean = float(by_seed.mean())
    if np.isfinite(table[0]).sum(axis=1).max() < MIN_CAMERAS:
        return Ratio(float(np.exp(mean)))
    (of_seeds,), freedom = seed_variance(by_seed)
    draws = replicates(table, centre, same_cameras)
    of_cameras = camera_variance(table[0], draws[:, 0] - draws[:, 1], of_seeds, same_cameras)
    variance, freedom = combined(of_seeds, freedom, *of_cameras)
    return _exponential(judged(mean, float(np.sqrt(variance)), freedom))


def time_ratio(new_s: Floats, old_s: Floats) -> Ratio:
    """Ratio of the times of two methods from the rounds of two runs, which do not belong together one by one."""
    return _exponential(unpaired(np.log(new_s), np.log(old_s)))


def mean_ratio(ratios: Sequence[Ratio]) -> Ratio:
    """Geometric mean of the ratios on several problems, by Student's t over the problems; one problem's as it is."""
    known = [ratio for ratio in ratios if np.isfinite(ratio.value)]
    if len(known) < 2:
        return known[0] if known else Ratio(float("nan"))
    logs = np.log([ratio.value for ratio in known])
    return _exponential(paired(logs, np.zeros(len(logs))))


def _exponential(of: Difference) -> Ratio:
    value, low, high = np.exp([of.mean, of.low, of.high])
    return Ratio(float(value), float(low), float(high), min(2 * min(of.p_below, of.p_above), 1.0))
