"""From logits to cameras: sources, refinement, the best of what the sources tell."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Problem, so3

from ..directed import DirectedGraph
from ..layers import Arrays, within
from ..quaternions import product
from ..triangles import triangle_features
from . import network
from .propagation import propagated
from .refinement import refined, weights_of

MOST, FEWEST, VISITS = 20, 2, 4_000_000  # sources; and visits of edges in one propagation from all, where they decide
AFTERWARDS = 6  # rounds after every camera is reached
PASSES, DAMPING = 4, 0.8
ROUNDS_KEPT = 50_000_000  # numbers that the rounds of one source may take


@dataclass(frozen=True, eq=False)
class View:
    """A graph as the networks see it.

    Parameters
    ----------
    graph
        Both directions of its edges.
    triangles
        (m, FEATURES), see `triangle_features`.
    noise
        Scale in radians at which good triangles close.
    """

    graph: DirectedGraph
    triangles: Floats
    noise: float

    @classmethod
    def of(cls, problem: Problem) -> "View":
        """Of a connected problem without parallel edges."""
        triangles, noise = triangle_features(problem)
        return cls(DirectedGraph.of(problem), triangles, noise)

    @property
    def measured(self) -> Floats:
        """(2m, MEASURED) what `WeightNet` sees."""
        return network.measured(self.graph, self.triangles)

    def seen(self, logits: Floats, asked: Floats) -> Floats:
        """(2m, SEEN) what `VoteNet` sees."""
        return network.seen(self.graph, self.triangles, logits, asked, self.noise)


@dataclass(frozen=True)
class Sources:
    """Where propagation starts, and for how long it goes on."""

    cameras: tuple[int, ...]
    rounds: int

    @classmethod
    def of(cls, graph: DirectedGraph, weights: Floats, most: int = MOST) -> "Sources":
        """The cameras with the largest sums of weights, fewer of them on large and on long graphs."""
        order = np.argsort(-graph.sums(weights[graph.edge][:, None])[:, 0], kind="stable")
        count = most
        while True:
            cameras = order[:count]
            rounds = int(_distances(graph, cameras).max()) + AFTERWARDS
            allowed = max(FEWEST, VISITS // (len(graph.at) * rounds))
            if count <= allowed:
                return cls(tuple(cameras.tolist()), rounds)
            count = allowed

    def affordable(self, graph: DirectedGraph) -> bool:
        """Whether the rounds of a source can be kept, which the derivative needs."""
        return self.rounds * graph.n * 9 <= ROUNDS_KEPT


def start(graph: DirectedGraph, logits: Floats, sources: Sources, steps: int) -> tuple[Floats, Floats]:
    """Cameras (n, 4) and logits (m,) after refinement: what the source tells that has the least loss."""
    logits, losses = refined(graph, logits, sources.cameras, sources.rounds, steps)
    best = sources.cameras[int(np.argmin(losses))]
    return propagated(graph, weights_of(logits), best, sources.rounds).last, logits


def moved(cameras: Floats, steps: Floats) -> Floats:
    """Cameras (n, 4) turned by steps (n, 3) in their own frames."""
    return product(so3.to_quaternion(so3.exp(DAMPING * steps)), cameras)


def finely(arrays: Arrays, view: View, cameras: Floats, logits: Floats) -> Floats:
    """Cameras (n, 4) after all passes of `VoteNet`."""
    for _ in range(PASSES):
        asked = network.asked_of(view.graph, cameras)
        cameras = moved(
            cameras, network.camera_steps(within(arrays, "votes"), view.graph, view.seen(logits, asked), asked)
        )
    return cameras


def _distances(graph: DirectedGraph, cameras: NDArray[np.intp]) -> NDArray[np.float64]:
    """(k, n) number of edges from each of k cameras to every camera."""
    from scipy import sparse
    from scipy.sparse.csgraph import dijkstra

    ones = np.ones(len(graph.other), dtype=np.int8)
    pattern = sparse.csr_array((ones, graph.other, graph.first), shape=(graph.n, graph.n))
    return np.asarray(dijkstra(pattern, unweighted=True, indices=cameras))
