"""Confidence intervals of every row of a scored run."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from bench.core.problem import Floats
from bench.scoring.inference.resampling import Statistic
from bench.scoring.inference.statistics import MIN_CAMERAS, confidence_interval
from bench.scoring.results import CONFIGURED, PLACE, Configured, Place

STATISTICS: tuple[Statistic, ...] = ("mean", "median")


def with_intervals(frame: pd.DataFrame, errors: Mapping[Place, Mapping[Configured, Sequence[Floats]]]) -> pd.DataFrame:
    """Rows with the columns ``{mean,median}_{low,high}_deg``: 95 % bootstrap intervals over the cameras of a row.

    NaN where fewer than `MIN_CAMERAS` cameras were scored, and for rows that are not of what a method returned.
    """
    waiting = {(place, key): iter(several) for place, own in errors.items() for key, several in own.items()}
    ends = [
        _ends(next(waiting.get((key[:3], key[3:]), iter(())), None))
        for key in zip(*(map(str, frame[name]) for name in (*PLACE, *CONFIGURED)), strict=True)
    ]
    return frame.assign(**pd.DataFrame(ends, index=frame.index))


def _ends(errors: Floats | None) -> dict[str, float]:
    known = errors is not None and np.isfinite(errors).sum() >= MIN_CAMERAS
    found: dict[str, float] = {}
    for statistic in STATISTICS:
        low, high = confidence_interval(errors, statistic) if known and errors is not None else (np.nan, np.nan)
        found |= {f"{statistic}_low_deg": low, f"{statistic}_high_deg": high}
    return found
