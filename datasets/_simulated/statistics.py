"""What Table I of the founding paper prints of a scene."""

import numpy as np

from bench import Problem

_DENSE = 500  # cameras, above which the sparse solver is quicker


def statistics(problem: Problem, hardness_of: Problem | None = None) -> dict[str, float]:
    """Number of cameras, edges in percent of all pairs, and hardness (of `hardness_of`, where given)."""
    return {
        "cameras": float(problem.n),
        "edges_percent": 100 * problem.m / (problem.n * (problem.n - 1) / 2),
        "hardness": hardness(hardness_of or problem),
    }


def hardness(problem: Problem) -> float:
    """Second smallest eigenvalue of the graph Laplacian, divided by n; the lower, the harder.

    Wilson, Bindel and Snavely (2016) derive it; Table I of the paper prints 0.0088 for Ellis Island. It is
    0 for a graph that is not connected.
    """
    if problem.components.any():
        return 0.0
    laplacian = problem.laplacian()
    if problem.n <= _DENSE:
        return float(np.linalg.eigvalsh(laplacian.toarray())[1] / problem.n)
    from scipy.sparse.linalg import eigsh

    shift = -1e-3 * problem.degree.mean()  # just below the spectrum, so that the matrix factored is definite
    start = np.cos(np.arange(problem.n))  # any fixed vector, so that the digits do not change from run to run
    values = eigsh(laplacian.tocsc(), k=2, sigma=shift, v0=start, return_eigenvectors=False)
    return float(np.sort(values)[1] / problem.n)
