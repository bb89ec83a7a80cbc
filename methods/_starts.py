"""Where iterative methods start from, the same for all of them."""

from typing import Literal

import numpy as np

from bench import so3
from bench.problem import Floats, Problem

from . import spectral
from .spanning_tree import tree_rotations

Start = Literal["spectral", "spanning-tree", "random"]
TOLERANCE = 1e-2  # radians between the eigenspace found and the true one; a start need not be better


class Started:
    """Promises of a method that depend on its start: a random one may end in another local minimum."""

    init: Start

    @property
    def deterministic(self) -> bool:
        """A random start is not."""
        return self.init != "random"

    @property
    def exact_to_deg(self) -> float:
        """Of no use (180) from a random start."""
        return 180.0 if self.init == "random" else 1e-6

    @property
    def invariant_to_deg(self) -> float | None:
        """Nothing from a random start."""
        return None if self.init == "random" else 1e-3


def start_rotations(name: Start, problem: Problem, rng: np.random.Generator) -> Floats:
    """Rotations (n, 3, 3) to start from.

    Parameters
    ----------
    name
        "spectral": the normalised spectral solution. "spanning-tree": propagation along the tree of
        `SpanningTree`, the one place where a problem's weights enter. "random": uniform on SO(3).
    """
    if name == "spectral":
        return spectral.spectral_rotations(problem, tolerance=TOLERANCE)[0]
    if name == "spanning-tree":
        return tree_rotations(problem, problem.weights)
    return so3.random(rng, problem.n)
