"""How far each measurement is to be trusted, as one number."""

import numpy as np

from bench import Floats, Problem


def confidence(problem: Problem) -> Floats:
    """(m,) factors of the edges' terms in a sum, with mean one; ones where nothing is known.

    Weights where there are any, otherwise the means of the three eigenvalues of each precision matrix.
    """
    if problem.weights is None and problem.precisions is not None:
        scale = np.trace(problem.precisions, axis1=1, axis2=2)
        return scale / scale.mean()
    return problem.relative_weights


def ranking(problem: Problem) -> Floats | None:
    """(m,) `confidence` for choosing among edges; None where nothing is known of them."""
    return None if problem.weights is None and problem.precisions is None else confidence(problem)


def strengths(problem: Problem) -> Floats:
    """(n,) sum of the `confidence` of the edges at each camera; its degree where nothing is known."""
    sums = np.bincount(problem.edges.ravel(), np.repeat(confidence(problem), 2), minlength=problem.n)
    return np.asarray(sums, dtype=np.float64)


def has_counts(problem: Problem) -> bool:
    """Whether the weights are numbers of matches."""
    return problem.weights is not None and problem.weights_kind == "count"
