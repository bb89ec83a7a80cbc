"""How well the weights that a method gave to the edges tell the true outliers from the rest."""

import numpy as np
from numpy.typing import NDArray

from bench.problem import Floats


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
