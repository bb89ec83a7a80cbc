"""Which of two methods is clearly better, for every pair: what an order must show before a change of it is told."""

from collections.abc import Hashable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from bench.core.problem import Floats
from bench.scoring.inference.difference import LEVEL
from bench.scoring.inference.resampling import FLOOR_DEG
from bench.scoring.inference.statistics import MIN_CAMERAS, MIN_COVERAGE, RESOLUTION

Key = TypeVar("Key", bound=Hashable)

RESAMPLES = 400


def clearly_better(errors: Mapping[Key, Sequence[Floats]]) -> set[tuple[Key, Key]]:
    """Pairs (a, b) on one instance where the median of a is better than that of b, and not by chance.

    A paired bootstrap: each resample draws the same seeds and cameras for all methods, and a is clearly better where
    its median over the cameras, averaged geometrically over the seeds, is lower by more than a ratio of 1 +
    `RESOLUTION` in all but `LEVEL` / 2 of the resamples. The level, which has two sides, holds for each pair; a
    *reversal*, which takes two errors in opposite directions on nearly the same data, comes about by chance far more
    rarely.

    Parameters
    ----------
    errors
        For each method, one array (n,) a seed in degrees, NaN where not scored; a method that ran once stands for all
        seeds.

    Returns
    -------
    set
        Methods are compared on the cameras that all of them scored; those that scored fewer than 95 % as many as the
        most complete one are not compared. Empty where these are fewer than `MIN_CAMERAS`.
    """
    counts = {key: float(np.mean([np.isfinite(e).sum() for e in seeds])) for key, seeds in errors.items() if seeds}
    most = max(counts.values(), default=0)
    methods = [key for key, count in counts.items() if count > 0 and count >= MIN_COVERAGE * most]
    if len(methods) < 2:
        return set()
    number = max(len(errors[key]) for key in methods)
    methods = [key for key in methods if len(errors[key]) in (1, number)]
    by_seed = [np.array([errors[key][min(s, len(errors[key]) - 1)] for key in methods]) for s in range(number)]
    by_seed = [table[:, np.isfinite(table).all(axis=0)] for table in by_seed]
    if min(table.shape[1] for table in by_seed) < MIN_CAMERAS:
        return set()
    draws = _resampled(by_seed)
    share = (draws[:, None] < draws[None] - RESOLUTION).mean(axis=2)
    return {(methods[a], methods[b]) for a, b in np.argwhere(share >= 1 - LEVEL / 2)}


def _resampled(by_seed: Sequence[Floats]) -> Floats:
    """(methods, RESAMPLES) logarithms of the median of errors (methods, cameras), one array a seed."""
    rng = np.random.default_rng(0)
    of_seeds = []
    for table in by_seed:
        picked = rng.integers(table.shape[1], size=(RESAMPLES, table.shape[1]))
        of_seeds.append([np.log(np.maximum(np.median(row[picked], axis=1), FLOOR_DEG)) for row in table])
    chosen = rng.integers(len(by_seed), size=(len(by_seed), RESAMPLES))
    stacked = np.array(of_seeds)  # (seeds, methods, resamples)
    drawn: Floats = np.take_along_axis(stacked, chosen[:, None], axis=0).mean(axis=0)
    return drawn
