"""Where iterative methods start from, the same for all of them."""

from typing import Literal

import numpy as np

from bench import Floats, Problem, so3

from .graph.cemp import TRIANGLES, corruption_levels, tree_of_least_corruption
from .graph.confidence import confidence, has_counts, ranking
from .graph.trees import tree_rotations
from .graph.triangles import sample_triangles
from .linear.spectral import spectral_rotations
from .warm_up import Warm

Start = Literal["auto", "spectral", "spanning-tree", "cemp-mst", "random"]
SEEDED = ("cemp-mst", "random")  # starts that draw from the generator, so that no method is deterministic with them
TOLERANCE = 1e-2  # radians between the eigenspace found and the true one; a start need not be better


class Seeded(Warm):
    """A method that draws nothing but its start."""

    init: str

    @property
    def deterministic(self) -> bool:
        """A start that draws from the generator is not."""
        return self.init not in SEEDED


class Started(Seeded):
    """Promises of a method that depend on its start: a random one may end in another local minimum."""

    @property
    def exact_to_deg(self) -> float | None:
        """Nothing from a random start."""
        return None if self.init == "random" else 1e-6

    @property
    def invariant_to_deg(self) -> float | None:
        """Nothing from a random start."""
        return None if self.init == "random" else 1e-3


class Refined(Started):
    """Promises of a method that draws triangles, and refines until the mean step is below a tolerance."""

    tolerance_deg: float

    @property
    def deterministic(self) -> bool:
        """Where an edge has many triangles some are drawn."""
        return False

    @property
    def exact_to_deg(self) -> float:
        """From a random start only as near as the last step tells."""
        return self.tolerance_deg if self.init == "random" else 1e-6


def resolved(name: Start, problem: Problem) -> Start:
    """The start that "auto" stands for, see `start_rotations`."""
    if name != "auto":
        return name
    return "spanning-tree" if has_counts(problem) else "spectral"


def start_rotations(name: Start, problem: Problem, rng: np.random.Generator) -> Floats:
    """Rotations (n, 3, 3) to start from.

    Parameters
    ----------
    name
        "spectral": the normalised spectral solution, D regularised by its mean. "spanning-tree": propagation
        along the tree of `SpanningTree`. Both use the `confidence` of the edges. "auto": "spanning-tree" where the
        edges come with match counts, which tell good ones from bad; otherwise "spectral". "cemp-mst": propagation
        along the tree that `CEMP` with its default parameters finds. "random": uniform on SO(3).
    """
    name = resolved(name, problem)
    if name == "spectral":
        return spectral_rotations(problem, confidence(problem), regularisation=1.0, tolerance=TOLERANCE)[0]
    if name == "spanning-tree":
        return tree_rotations(problem, ranking(problem))
    if name == "cemp-mst":
        levels = corruption_levels(sample_triangles(problem, TRIANGLES, rng))
        return tree_of_least_corruption(problem, levels)
    return so3.random(rng, problem.n)
