"""Whether the errors of the edges at a camera point the same way."""

import numpy as np

from bench import Floats, Problem

PRIOR = 0.3  # chance that they do, before the residuals are looked at
SHARE, SPREAD = 0.045, 0.03  # what the edges of a camera then have in common: its mean over graphs, and how it varies
NONE = 0.003  # what it may be where errors are independent, since a solution bends to them
OUTSIDE = 2.0  # scales, beyond which residuals tell


def correlation(problem: Problem, vectors: Floats, angles: Floats, wider: Floats) -> float:
    """Chance that the errors at a camera point the same way, from residuals beyond two scales.

    The statistic is the share that the edges of a camera have in common of the directions of their residuals (the
    one-way variance component, one for the graph): zero up to its standard error where errors are independent, and over
    simulated graphs of correlated ones 0.045, with standard deviation 0.03, or more.

    Parameters
    ----------
    vectors, angles, wider
        (m, 3), (m,) residuals and (m,) scales of the edges, radians.
    """
    outside = angles > OUTSIDE * wider
    ends = problem.edges[outside].T.ravel()
    directions = vectors[outside] / angles[outside, None]
    signed = np.concatenate([directions, -directions])
    counts = np.bincount(ends, minlength=problem.n)
    told = counts > 1
    if not told.any():
        return PRIOR
    sums = np.stack([np.bincount(ends, column, problem.n) for column in signed.T])
    squares = (sums**2).sum(axis=0)[told] / counts[told]
    pairs = (counts[told] - 1).sum()
    share = (squares - 1).sum() / pairs
    error = np.sqrt(2 / 3 * (1 - 1 / counts[told]).sum()) / pairs
    correlated = PRIOR * _density(min(share - SHARE, 0.0), np.hypot(SPREAD, error))
    independent = (1 - PRIOR) * _density(share, np.hypot(NONE, error))
    return float(correlated / (correlated + independent))


def _density(value: float, deviation: float) -> float:
    """Of a normal distribution of mean zero, up to a constant."""
    return float(np.exp(-((value / deviation) ** 2) / 2) / deviation)
