"""Whether a mean difference lies below or above a margin: Student's and Welch's t, and Holm's correction."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.core.problem import Floats

LEVEL = 0.05
SMALLEST = 1e-9  # degrees; a standard deviation below this is rounding


@dataclass(frozen=True)
class Difference:
    """A mean difference, left minus right.

    Parameters
    ----------
    mean, low, high
        The estimate and its 95 % t interval, in the units of the samples; NaN where there are too few.
    p_below, p_above
        One-sided p values of the mean difference not being below, or not above, the margin.
    """

    mean: float
    low: float
    high: float
    p_below: float
    p_above: float


def paired(left: Floats, right: Floats, margin: float = 0.0) -> Difference:
    """Compare samples (k,) that belong together one by one, such as two methods on the same problems."""
    d = np.asarray(left, dtype=float) - np.asarray(right, dtype=float)
    if len(d) < 2:
        return Difference(float(d.mean()) if len(d) else np.nan, np.nan, np.nan, np.nan, np.nan)
    return judged(float(d.mean()), float(d.std(ddof=1) / np.sqrt(len(d))), len(d) - 1, margin)


def unpaired(left: Floats, right: Floats, margin: float = 0.0) -> Difference:
    """Compare independent samples (k,) and (l,) whose variances may differ (Welch 1947)."""
    a, b = (np.asarray(sample, dtype=float) for sample in (left, right))
    mean = float(a.mean() - b.mean()) if len(a) and len(b) else np.nan
    if min(len(a), len(b)) < 2:
        return Difference(mean, np.nan, np.nan, np.nan, np.nan)
    variances = a.var(ddof=1) / len(a), b.var(ddof=1) / len(b)
    total = float(sum(variances))
    parts = variances[0] ** 2 / (len(a) - 1) + variances[1] ** 2 / (len(b) - 1)
    freedom = total**2 / float(parts) if parts > 0 else float(len(a) + len(b) - 2)
    return judged(mean, float(np.sqrt(total)), freedom, margin)


def judged(mean: float, error: float, freedom: float, margin: float = 0.0) -> Difference:
    """Student's t for a mean difference with its standard error and degrees of freedom."""
    from scipy.special import stdtr, stdtrit

    if error < SMALLEST:
        below, above = (0.0 if sign * (mean - margin) > SMALLEST else 1.0 for sign in (-1, 1))
        return Difference(mean, mean, mean, below, above)
    half = float(stdtrit(freedom, 1 - LEVEL / 2)) * error
    below = float(stdtr(freedom, (mean - margin) / error))
    return Difference(mean, mean - half, mean + half, below, 1 - below)


def holm(p_values: Sequence[float]) -> list[float]:
    """P values corrected for their number (Holm 1979); NaN stays, and does not count."""
    p = np.asarray(p_values, dtype=float)
    out = np.full(len(p), np.nan)
    order = np.argsort(p)[: np.isfinite(p).sum()]
    raised = p[order] * np.arange(len(order), 0, -1)
    out[order] = np.minimum(1, np.maximum.accumulate(raised))
    return [float(value) for value in out]
