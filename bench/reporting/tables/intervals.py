"""Confidence intervals of every row of a scored run."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from bench.core.problem import Floats
from bench.scoring.inference.resampling import Statistic
from bench.scoring.inference.statistics import MIN_CAMERAS, confidence_interval
from bench.scoring.metrics.oracle import ORACLE

STATISTICS: tuple[Statistic, ...] = ("mean", "median")


def with_intervals(frame: pd.DataFrame, job_errors: Mapping[str, Floats]) -> pd.DataFrame:
    """Rows with the columns ``{mean,median}_{low,high}_deg``: 95 % bootstrap intervals over the cameras of a row.

    NaN where fewer than `MIN_CAMERAS` cameras were scored, and for rows that are not of what a method returned.
    """
    rows = zip(frame["job"], frame["stop_reason"], strict=True)
    ends = [_ends(job_errors.get(job) if reason != ORACLE else None) for job, reason in rows]
    return frame.assign(**pd.DataFrame(ends, index=frame.index))


def _ends(errors: Floats | None) -> dict[str, float]:
    enough = errors if errors is not None and np.isfinite(errors).sum() >= MIN_CAMERAS else np.empty(0)
    found: dict[str, float] = {}
    for statistic in STATISTICS:
        low, high = confidence_interval(enough, statistic)
        found |= {f"{statistic}_low_deg": low, f"{statistic}_high_deg": high}
    return found
