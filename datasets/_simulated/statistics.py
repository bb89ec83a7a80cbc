"""What Table I of the founding paper prints of a scene."""

from typing import TYPE_CHECKING

import numpy as np

from bench import Problem

if TYPE_CHECKING:
    from scipy import sparse

_DENSE = 500  # cameras, above which the sparse solver is quicker
_RESTARTS = 10  # of the Lanczos iteration: enough on random graphs, and little lost on others


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
    return _second_smallest(laplacian, problem.degree.mean()) / problem.n


def _second_smallest(laplacian: "sparse.csr_array", degree: float) -> float:
    """Of the eigenvalues of a Laplacian: by its products alone where that is quick, as on random graphs, else factored.

    The eigenvalues of a graph as thin as a street fall as 1/n^2, and the shift with them: from further away they look
    alike, and the iteration does not end.
    """
    from scipy.sparse.linalg import ArpackNoConvergence, eigsh

    n = laplacian.shape[0]
    start = np.cos(np.arange(n))  # any fixed vector, so that the digits do not change from run to run
    try:
        values = eigsh(laplacian, k=2, which="SA", v0=start, maxiter=_RESTARTS, return_eigenvectors=False)
    except ArpackNoConvergence:
        shift = -1e-3 * degree * (_DENSE / n) ** 2  # just below the spectrum, so that the matrix factored is definite
        values = eigsh(laplacian.tocsc(), k=2, sigma=shift, v0=start, return_eigenvectors=False)
    return float(np.sort(values)[1])
