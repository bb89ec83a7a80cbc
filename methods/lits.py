"""LITS: a layer that turns every camera by what it has learned to read in the residuals of its edges, ten times."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Learned, Problem, Trainer, method, so3

from ._lib.learned.directed import DirectedGraph
from ._lib.learned.lits import network


@method(
    "lits",
    title="LITS",
    cite="yew2021",
    requires=("scipy",),
    supervised=True,
    robust=True,
    exact_to_deg=None,  # of a ring or a tree it has not learned, but from graphs with many triangles
    invariant_to_deg=5e-4,
    frames_to_deg=None,  # it has learned how cameras are held
)
@dataclass(frozen=True)
class LITS(Learned):
    """Minimises nothing: a network that has learned to lower a robust error of relative rotations.

    From the identity, ten times, with the same weights:

    1. The residual of every edge, R_i R_j^T R_ij^T in the frame of camera i, and the features of i and j give a message
       to i, and a trust in it, between 0 and 1, that also depends on the largest that other messages to i have to say.
    2. The sum of the messages, by their trust and made as long as 1, the features of the camera and those of the whole
       graph give a rotation that R_i is multiplied by from the left, and new features.

    No start is needed, and nothing depends on the gauge.

    Source: Yew and Lee, 3DV 2021, and their code (github.com/yewzijian/MultiReg, MIT), from which the layers, their
    widths, the loss and the clipping of the gradient are taken. Ours is what it learns from, simulated graphs of
    another law than theirs and no real scene: at most 800 edges of each in a step, an eighth of the steps with every
    camera's frame turned at random. Deviations: an edge's residual is told twice, as nine entries and as a vector that
    grows with the logarithm of the angle, so that small ones are told apart after a short training (384 more
    parameters); Adam with rate 0.002 for RMSprop with 0.0003; the weights are a running mean of those of the last
    steps; some 106,000 steps for 200,000.

    It is not exact. On noise-free graphs of real topologies most cameras are within 0.2 degrees; rings, trees and
    graphs of which it has seen few may be off by any angle. So may a piece of a scene that hangs on to the rest by few
    right edges.
    """

    learns_from = (
        "view-graph[noise=correlated,cameras=[30,50,80,120]]",
        "collection-graph[n=[60,100,160]]",
        "view-graph[noise=correlated,cameras=[40,60,100]]",
        "erdos-renyi[n=[60,100],missing=[0.5,0.8],noise=tangent,noise_deg=2,outliers=0.2]",
    )

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        graph = DirectedGraph.of(problem)
        rotations, trust = network.solve(self.trained().arrays, graph)
        weights = np.empty(problem.m)
        weights[graph.edge] = (trust + trust[graph.reverse]) / 2
        return Estimate(
            so3.project(rotations.astype(np.float64)),
            edge_weights=weights,
            iterations=network.ITERATIONS,
            stop_reason="fixed number of iterations",
            notes=(self.note(),),
        )

    def trainer(self, seed: int) -> Trainer:
        """What learns its weights."""
        from ._lib.learned.lits.training import trainer

        return trainer(seed)
