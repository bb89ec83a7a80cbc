"""Confidence intervals of every row of a scored run."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from bench.core.outcome import OK
from bench.core.problem import Floats
from bench.scoring.inference.resampling import Statistic
from bench.scoring.inference.statistics import MIN_CAMERAS, confidence_interval, seed_half_width
from bench.scoring.metrics.oracle import ORACLE
from bench.scoring.results import CONFIGURED, PLACE

STATISTICS: tuple[Statistic, ...] = ("mean", "median")


def with_intervals(frame: pd.DataFrame, job_errors: Mapping[str, Floats]) -> pd.DataFrame:
    """Rows with their 95 % intervals, over cameras and over seeds.

    The columns ``{mean,median}_{low,high}_deg`` are bootstrap intervals over the cameras of a row: NaN where fewer than
    `MIN_CAMERAS` cameras were scored, and for rows that are not of what a method returned. The columns
    ``{mean,median}_pm_deg`` are the half-width that other formats print after a ±: of the t interval of the mean over
    the seeds of that method on that scene, the same in each of its rows; NaN where fewer than two seeds ended well.
    """
    rows = zip(frame["job"], frame["stop_reason"], strict=True)
    ends = [_ends(job_errors.get(job) if reason != ORACLE else None) for job, reason in rows]
    well = frame.where(frame["outcome"] == OK)
    groups = [frame[name] for name in (*PLACE, *CONFIGURED)]
    spreads: dict[str, Any] = {
        f"{statistic}_pm_deg": well[f"{statistic}_deg"].groupby(groups, dropna=False).transform(_half_width)
        for statistic in STATISTICS
    }
    return frame.assign(**pd.DataFrame(ends, index=frame.index), **spreads)


def _half_width(values: "pd.Series[float]") -> Any:
    return seed_half_width(values.tolist())


def _ends(errors: Floats | None) -> dict[str, float]:
    enough = errors if errors is not None and np.isfinite(errors).sum() >= MIN_CAMERAS else np.empty(0)
    found: dict[str, float] = {}
    for statistic in STATISTICS:
        low, high = confidence_interval(enough, statistic)
        found |= {f"{statistic}_low_deg": low, f"{statistic}_high_deg": high}
    return found
