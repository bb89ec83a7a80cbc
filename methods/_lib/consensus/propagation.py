"""How errors of the edges add up on their way through the graph."""

from collections.abc import Callable

import numpy as np

from bench import Floats, Problem

Inverse = Callable[[Floats], Floats]  # of a Laplacian; see `LaplacianSolver.inverse`
EXACT = 500  # cameras, up to which variances are exact
PROBES = 24  # draws of errors that tell them beyond, to some 15 %
ROUNDS = 3  # of finding the gauge
MOST_LEVERAGE = 0.9
TINY = np.finfo(np.float64).tiny


def strengths(problem: Problem, weights: Floats) -> Floats:
    """(n,) sums of the weights (m,) at each camera."""
    i, j = problem.edges.T
    return np.asarray(np.bincount(i, weights, problem.n) + np.bincount(j, weights, problem.n))


def without_own_edge(problem: Problem, weights: Floats, angles: Floats) -> Floats:
    """Residuals (m,) as if their edge had not taken part: over 1 - h, h being its weight over the sums at its cameras.

    That is the leverage of the edge where its neighbours are held, and at most 0.9; the weights (m,) are positive.
    """
    i, j = problem.edges.T
    sums = strengths(problem, weights)
    return np.asarray(angles / (1 - np.minimum(weights * (1 / sums[i] + 1 / sums[j]), MOST_LEVERAGE)))


def added_up(problem: Problem, weights: Floats, inverse: Inverse) -> Floats:
    """(n,) standard errors of the cameras, each over what it would be if the neighbours of the camera stood right.

    With independent errors of variance 1 / w_ij the covariance of the cameras is the pseudo-inverse K of the Laplacian
    of the weights, and the variance of a camera whose neighbours are held is one over the sum of its weights. In a
    sequence the former grows along the way. Errors are those left by the alignment of all cameras by a median, which
    those that hang on by little do not turn: by their mean, weighted by one over their standard errors.

    Parameters
    ----------
    weights
        (m,) positive.
    inverse
        Of the Laplacian of the weights.
    """
    n = problem.n
    if n <= EXACT:
        covariance = inverse(np.eye(n) - 1 / n)
        variance = _aligned(n, lambda gauge: _exact(covariance, gauge))
    else:
        errors = inverse(_divergence_of_noise(problem, weights))
        variance = _aligned(n, lambda gauge: np.asarray(((errors - gauge @ errors) ** 2).mean(axis=1)))
    return np.sqrt(variance * strengths(problem, weights))


def _aligned(n: int, variance: Callable[[Floats], Floats]) -> Floats:
    """(n,) variances, given how they follow from the weights (n,) of the cameras in the gauge."""
    gauge = np.full(n, 1 / n)
    for _ in range(ROUNDS):
        found = np.maximum(variance(gauge), TINY)
        gauge = found**-0.5 / (found**-0.5).sum()
    return found


def _exact(covariance: Floats, gauge: Floats) -> Floats:
    """(n,) variances of the x_i less sum_k g_k x_k, where x has this covariance (n, n)."""
    with_gauge = covariance @ gauge
    return np.asarray(covariance.diagonal() - 2 * with_gauge + gauge @ with_gauge)


def _divergence_of_noise(problem: Problem, weights: Floats) -> Floats:
    """(n, PROBES) right-hand sides of normal equations for errors of variance 1 / w; always the same draws."""
    rng = np.random.default_rng(0)
    i, j = problem.edges.T
    result = np.empty((problem.n, PROBES))
    for column in result.T:
        noise = np.sqrt(weights) * rng.choice([-1.0, 1.0], len(weights))
        column[:] = np.bincount(i, noise, problem.n) - np.bincount(j, noise, problem.n)
    return result
