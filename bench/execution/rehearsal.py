"""A method that does nothing, for the rehearsal of the fork server."""

from dataclasses import dataclass

import numpy as np

from bench.core.problem import Floats, Problem
from bench.plugins.declare import method

NAME = "rehearsal"


@method(NAME, title="Rehearsal")
@dataclass(frozen=True)
class Rehearsal:
    """Identity rotations."""

    def solve(self, problem: Problem, rng: np.random.Generator) -> Floats:
        """Say that every camera is at rest."""
        return np.tile(np.eye(3), (problem.n, 1, 1))
