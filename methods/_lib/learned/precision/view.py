"""What the network sees of a graph around a solution, and what its answers mean."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, Problem, so3

from ...consensus.correlation import correlation
from ...consensus.settling import CAUCHY, wider_scales
from ...consensus.solution import Solution
from ...descent.descent import Descent
from ..directed import DirectedGraph
from ..triangles import FEATURES, triangle_features

WIDTH = FEATURES + 13  # features of a directed edge
OUTPUTS = 4  # a logarithm, and a vector
PASSES = (0.25, 0.25, 0.5)  # of `solve`, and what each counts when it is learned
TURN = 0.5  # radians, as which measured rotations count
LEAST = 0.1  # added to a residual, in units of the scale, before its logarithm is taken
FAR, DENSE = 3.0, 5.0  # logarithms, of scales and of degrees, that count as one
STRONGEST = 3.0  # logarithm of the factor of a weight at most


@dataclass(frozen=True, eq=False)
class View:
    """A graph as the network sees it, but for the residuals.

    Parameters
    ----------
    graph
        Both directions of its edges.
    fixed
        (2m, WIDTH - 4) what does not change with the residuals.
    scales
        (m,) of the edges: the wider one of their cameras'.
    """

    graph: DirectedGraph
    fixed: Floats
    scales: Floats

    @classmethod
    def of(cls, problem: Problem, found: Solution) -> "View":
        """Around a solution."""
        graph, descent, fit = DirectedGraph.of(problem), found.descent, found.fit
        scales = wider_scales(problem.edges, fit.scales)
        turns = np.arcsinh(so3.log(graph.rotations) / TURN)
        triangles = triangle_features(problem)[0][graph.edge]
        own = np.log(fit.scales / found.noise) / FAR
        whole = [
            correlation(problem, descent.vectors, descent.angles, scales),
            float(fit.power == CAUCHY),
            np.median(own),
            np.log(2 * problem.m / problem.n) / DENSE,
        ]
        everywhere = np.tile(whole, (2 * problem.m, 1))
        fixed = np.column_stack([turns, triangles, own[graph.at], own[graph.other], everywhere])
        return cls(graph, fixed.astype(np.float32), scales)

    def frames(self, descent: Descent) -> Floats:
        """(2m, 3, 3) what takes residuals in the world to how each camera sees those of its edges."""
        return self.graph.forward[:, None, None] * so3.from_quaternion(descent.cameras)[self.graph.at]

    def features(self, descent: Descent) -> Floats:
        """(2m, WIDTH) of the directed edges, where the cameras of a descent are now.

        Residuals are those in the frames of the cameras, log(R_ij R_j R_i^T), in units of the scales.
        """
        edge, angles = self.graph.edge, descent.angles / self.scales
        seen = np.einsum("eab,eb->ea", self.frames(descent), (descent.vectors / self.scales[:, None])[edge])
        size = np.log(LEAST + angles[edge])
        return np.column_stack([self.fixed, np.arcsinh(seen), size]).astype(np.float32)

    def reach(self, descent: Descent) -> Floats:
        """(m,) radians that the error of a measurement has for a vector of length one.

        r s / (r + s): the smaller one of residual and scale, about; nothing where nothing is amiss.
        """
        return descent.angles * self.scales / (descent.angles + self.scales)

    def answers(self, descent: Descent, outputs: Floats) -> tuple[Floats, Floats]:
        """Factors (m,) of the weights, within exp(-3) and exp(3), and errors (m, 3) of the measurements, in the world.

        Both directions of an edge have a say: logarithms and vectors of `outputs` (2m, 4) are added.
        """
        edge, m = self.graph.edge, len(self.scales)
        logarithms = np.bincount(edge, outputs[:, 0], m)
        vectors = np.einsum("eba,eb->ea", self.frames(descent), outputs[:, 1:])
        errors = np.stack([np.bincount(edge, column, m) for column in vectors.T], axis=1)
        return np.exp(STRONGEST * np.tanh(logarithms / STRONGEST)), self.reach(descent)[:, None] * errors
