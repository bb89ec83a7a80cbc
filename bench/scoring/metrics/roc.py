"""How well the weights that a method gave to the edges tell the true outliers from the rest."""

import numpy as np
from numpy.typing import NDArray

from bench.core.problem import Floats


def roc_auc(weights: Floats, outliers: NDArray[np.bool_]) -> float:
    """Area under the receiver operating characteristic of edge weights, a high weight meaning an inlier.

    It is the probability that a random inlier has a higher weight than a random outlier, ties counting one half
    (Mann and Whitney 1947), computed from ranks. Only the order of the weights matters.

    Parameters
    ----------
    weights
        (m,), NaN on edges outside the component that was solved, which take no part.
    outliers
        (m,) True on outliers.

    Returns
    -------
    float
        In [0, 1]; NaN where there are no inliers or no outliers among the edges with a weight.
    """
    from scipy.stats import rankdata

    known = ~np.isnan(weights)
    inliers = ~outliers[known]
    good, bad = int(inliers.sum()), int((~inliers).sum())
    if good == 0 or bad == 0:
        return float("nan")
    ranks = rankdata(weights[known])
    return float((ranks[inliers].sum() - good * (good + 1) / 2) / (good * bad))


def roc_curve(weights: Floats, outliers: NDArray[np.bool_], points: int = 200) -> tuple[Floats, Floats]:
    """The curve under which `roc_auc` is the area: what is lost and what is caught when low weights are rejected.

    Parameters
    ----------
    weights, outliers
        (m,) as in `roc_auc`.
    points
        About how many are kept.

    Returns
    -------
    tuple
        Share (k,) of the inliers and share (k,) of the outliers that are below each threshold, from (0, 0) to
        (1, 1); edges of the same weight are rejected together. Empty where `roc_auc` is NaN.
    """
    known = ~np.isnan(weights)
    order = np.argsort(weights[known], kind="stable")
    ranked, bad = weights[known][order], outliers[known][order]
    if not 0 < bad.sum() < len(bad):
        return np.empty(0), np.empty(0)
    last = np.append(np.flatnonzero(ranked[1:] != ranked[:-1]), len(ranked) - 1)  # of each run of equal weights
    last = last[np.unique(np.linspace(0, len(last) - 1, points).astype(int))]
    caught, lost = np.cumsum(bad)[last] / bad.sum(), np.cumsum(~bad)[last] / (~bad).sum()
    return np.append(0, lost), np.append(0, caught)
