"""What the network sees of a graph: its measurements, its triangles, and the residuals where the cameras are now."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, Problem, so3

from ...consensus.evidence import noise_scale, support_by_triangles
from ...consensus.half_edges import HalfEdges
from ...descent.descent import Descent
from ..directed import DirectedGraph

WIDTH = 11  # features of a directed edge
PASSES = 8
WIDEST_DEG, NARROWEST = 20.0, 0.5  # scale of the first pass, and of the last in units of the noise scale
WIDER, EVERY = 3.0, 1e6  # noise scales at which triangles vouch besides 1; any triangle does at the last
TURN, MANY = 0.5, 4.0  # radians, and logarithm of a number of triangles, that count as one
LEAST = 0.1  # added to a residual, in units of the scale, before its logarithm is taken


@dataclass(frozen=True, eq=False)
class View:
    """A graph as the network sees it, but for the residuals.

    Parameters
    ----------
    graph
        Both directions of its edges.
    forward
        (2m,) 1 where a directed edge leads as the problem has it, -1 where it is the other direction.
    fixed
        (2m, 7) rotation vector of the measurement; logarithm of 1 + s, for the triangles s that close at the noise
        scale; their share of all triangles at the edge, and of those that close at three times that scale; whether
        there is any.
    scales
        (PASSES,) radians, falling evenly in their logarithms.
    """

    graph: DirectedGraph
    forward: Floats
    fixed: Floats
    scales: Floats

    @classmethod
    def of(cls, problem: Problem) -> "View":
        """Of a connected problem without parallel edges."""
        graph, half = DirectedGraph.of(problem), HalfEdges.of(problem)
        noise = noise_scale(half, problem.m)
        close, near, every = support_by_triangles(half, problem.m, noise * np.array([1, WIDER, EVERY]))
        total = np.maximum(every, 1)
        triangles = np.column_stack([np.log1p(close) / MANY, close / total, near / total, every > 0])
        turns = np.arcsinh(so3.log(graph.rotations) / TURN)
        scales = np.geomspace(max(np.radians(WIDEST_DEG), noise), NARROWEST * noise, PASSES)
        forward = np.where(graph.at == problem.edges[graph.edge, 0], 1.0, -1.0)
        return cls(graph, forward, np.column_stack([turns, triangles[graph.edge]]).astype(np.float32), scales)

    def features(self, descent: Descent, scale: float) -> Floats:
        """(2m, WIDTH) of the directed edges, where the cameras of a descent are now; float32.

        The residuals are those in the frames of the cameras, log(R_ij R_j R_i^T) in units of the scale, so that the
        world may be turned.
        """
        world = (self.forward[:, None] / scale) * descent.vectors[self.graph.edge]
        own = so3.from_quaternion(descent.cameras)[self.graph.at]
        seen = np.einsum("eab,eb->ea", own, world)
        size = np.log(LEAST + descent.angles[self.graph.edge] / scale)
        return np.column_stack([self.fixed, np.arcsinh(seen), size]).astype(np.float32)


def geman_mcclure(angles: Floats, scale: float) -> Floats:
    """(m,) weights of the Geman-McClure loss: what the gates multiply."""
    return np.asarray(1 / (1 + (angles / scale) ** 2) ** 2)
