"""A problem with some of its edges."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bench import Problem


def restricted(problem: Problem, kept: NDArray[np.bool_]) -> Problem:
    """The problem with the edges `kept` (m,) alone, and what came with them."""
    weights, precisions = (None if x is None else x[kept] for x in (problem.weights, problem.precisions))
    return replace(
        problem,
        edges=problem.edges[kept],
        rotations=problem.rotations[kept],
        weights=weights,
        precisions=precisions,
    )
