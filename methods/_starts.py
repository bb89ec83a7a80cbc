"""Where iterative methods start from, the same for all of them."""

from typing import Literal

import numpy as np

from bench import so3
from bench.problem import Floats, Problem

from . import spectral
from .spanning_tree import tree_rotations

Start = Literal["spectral", "spanning-tree", "random"]
TOLERANCE = 1e-2  # radians between the eigenspace found and the true one; a start need not be better


def start_rotations(name: Start, problem: Problem, rng: np.random.Generator) -> Floats:
    """Rotations (n, 3, 3) to start from.

    Parameters
    ----------
    name
        "spectral": the normalised spectral solution, D regularised by its mean. "spanning-tree": propagation
        along the tree of `SpanningTree`, the one place where a problem's weights enter. "random": uniform on
        SO(3).
    """
    if name == "spectral":
        return spectral.spectral_rotations(problem, regularisation=1.0, tolerance=TOLERANCE)[0]
    if name == "spanning-tree":
        return tree_rotations(problem, problem.weights)
    return so3.random(rng, problem.n)
