"""What the network sees of a graph: its measurements, its triangles, and the residuals where the cameras are now."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, Problem, so3

from ...descent.descent import Descent
from ..directed import DirectedGraph
from ..triangles import FEATURES, triangle_features

WIDTH = FEATURES + 8  # features of a directed edge
PASSES = 8
WIDEST_DEG, NARROWEST = 20.0, 0.5  # scale of the first pass, and of the last in units of the noise scale
TURN = 0.5  # radians, as which measured rotations count
LEAST_WEIGHT = 1e-7  # of an edge, lest cameras come loose whose edges are all far off
FIRST = 3.0  # logarithm of a scale in units of the last, as which it counts
LEAST = 0.1  # added to a residual, in units of the scale, before its logarithm is taken


@dataclass(frozen=True, eq=False)
class View:
    """A graph as the network sees it, but for the residuals.

    Parameters
    ----------
    graph
        Both directions of its edges.
    fixed
        (2m, FEATURES + 3) rotation vector of the measurement, and what the triangles say, see `triangle_features`.
    scales
        (PASSES,) radians, falling evenly in their logarithms.
    """

    graph: DirectedGraph
    fixed: Floats
    scales: Floats

    @classmethod
    def of(cls, problem: Problem) -> "View":
        """Of a connected problem without parallel edges."""
        graph = DirectedGraph.of(problem)
        triangles, noise = triangle_features(problem)
        turns = np.arcsinh(so3.log(graph.rotations) / TURN)
        scales = np.geomspace(max(np.radians(WIDEST_DEG), noise), NARROWEST * noise, PASSES)
        return cls(graph, np.column_stack([turns, triangles[graph.edge]]).astype(np.float32), scales)

    def features(self, descent: Descent, scale: float) -> Floats:
        """(2m, WIDTH) of the directed edges, where the cameras of a descent are now; float32.

        The residuals are those in the frames of the cameras, log(R_ij R_j R_i^T) in units of the scale, so that the
        world may be turned. The last feature is the same for all: how far the scale is from the last one.
        """
        world = (self.graph.forward[:, None] / scale) * descent.vectors[self.graph.edge]
        own = so3.from_quaternion(descent.cameras)[self.graph.at]
        seen = np.einsum("eab,eb->ea", own, world)
        size = np.log(LEAST + descent.angles[self.graph.edge] / scale)
        stage = np.full(len(size), np.log(scale / self.scales[-1]) / FIRST)
        return np.column_stack([self.fixed, np.arcsinh(seen), size, stage]).astype(np.float32)


def geman_mcclure(angles: Floats, scale: float) -> Floats:
    """(m,) weights of the Geman-McClure loss: what the gates multiply, before `LEAST_WEIGHT` is added."""
    return np.asarray(1 / (1 + (angles / scale) ** 2) ** 2)
