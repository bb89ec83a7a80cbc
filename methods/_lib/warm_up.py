"""What a method does once before its time is taken: compile its kernels, load what it imports."""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bench import Estimate, Problem

from .linear import laplacian
from .linear.spectral import spectral_rotations

LARGE = 101  # cameras; where iterations take over from LAPACK


class Solver(Protocol):
    """Any method."""

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:
        """Rotations of a problem."""


class Warm:
    """A method that is warm after it has solved one triangle."""

    def warm_up(self: Solver) -> None:
        """Compile the kernels and load what `solve` imports."""
        solved_once(self)


def solved_once(method: Solver, cameras: int = 3) -> None:
    """Let a method solve a complete graph of identities; and do what only the spectral start of large graphs does."""
    for problem in large_graphs():
        spectral_rotations(problem)
    laplacian.compile_and_load()
    i, j = np.triu_indices(cameras, 1)
    method.solve(_identities(cameras, np.stack([i, j], axis=1)), np.random.default_rng(0))


def large_graphs() -> Iterator[Problem]:
    """A complete graph and a chain, which take different ways to their eigenvectors."""
    yield _identities(LARGE, np.stack(np.triu_indices(LARGE, 1), axis=1))
    yield _identities(LARGE, np.stack([np.arange(LARGE - 1), np.arange(1, LARGE)], axis=1))


def _identities(cameras: int, edges: NDArray[np.intp]) -> Problem:
    return Problem(cameras, edges.astype(np.int32), np.tile(np.eye(3), (len(edges), 1, 1)))
