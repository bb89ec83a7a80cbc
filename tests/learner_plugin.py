"""A plug-in that learns one number: how fast an edge loses weight with its residual to a first solution."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench import Estimate, Floats, Instance, Learned, Problem, Trainer, method, so3


def spectral(problem: Problem, weights: Floats) -> Floats:
    """Rotations (n, 3, 3) from the leading eigenvectors of the weighted measurements."""
    _, vectors = np.linalg.eigh(problem.block_matrix(weights).toarray())
    blocks = vectors[:, -3:].reshape(problem.n, 3, 3)
    return so3.project(blocks if np.linalg.det(blocks).sum() > 0 else -blocks)


def reweighted(problem: Problem, rate: float, rounds: int = 1) -> Floats:
    """Rotations (n, 3, 3) from a first solution and some rounds."""
    found = spectral(problem, np.ones(problem.m))
    for _ in range(rounds):
        found = spectral(problem, np.exp(-rate * problem.residuals(found)))
    return found


@method("learner", title="Learner", requires=("scipy",), supervised=True)
@dataclass(frozen=True)
class Learner(Learned):
    """A spectral solution, and rounds of it with weights exp(-rate residual); the rate is learned."""

    rounds: int = 1

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:
        """Rotations of a problem."""
        rate = float(self.trained().arrays["rate"])
        return Estimate(reweighted(problem, rate, self.rounds), notes=(self.note(),))

    def trainer(self, seed: int) -> Trainer:
        """What learns the rate."""
        return Descent(np.float32(np.random.default_rng(seed).uniform(0.1, 0.2)))


class Descent:
    """Plain gradient descent, by differences."""

    batch = 2

    def __init__(self, rate: np.float32) -> None:
        self.rate = rate

    def step(self, graphs: Sequence[Instance], rng: np.random.Generator) -> float:
        """One step."""
        loss, more = (np.mean([_loss(graph, self.rate + d) for graph in graphs]) for d in (0, 0.05))
        self.rate = np.float32(np.clip(self.rate - 5 * (more - loss) / 0.05, 0, 20))
        return float(loss)

    def loss(self, graph: Instance) -> float:
        """The loss on a graph."""
        return _loss(graph, self.rate)

    def weights(self) -> dict[str, np.ndarray]:
        """The rate."""
        return {"rate": np.array(self.rate)}

    def state(self) -> dict[str, np.ndarray]:
        """The rate, which is all there is."""
        return {"rate": np.array(self.rate)}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Go on."""
        self.rate = np.float32(state["rate"])


def _loss(graph: Instance, rate: float) -> float:
    """Mean angle in radians between relative rotations of the estimate and of the truth, over the edges."""
    assert graph.truth is not None
    i, j = graph.problem.edges.T
    true = replace(graph.problem, rotations=graph.truth[i] @ np.swapaxes(graph.truth[j], 1, 2))
    return float(np.mean(true.residuals(reweighted(graph.problem, float(rate)))))
