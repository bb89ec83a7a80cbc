"""RAGO: recurrent units that rectify edges and move cameras in turn, from a tree, for a fixed number of steps."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bench import Estimate, Learned, Problem, Trainer, method, parameter, so3

from ._lib.graph.all_triangles import AllTriangles
from ._lib.graph.hierarchical_tree import supported_tree
from ._lib.learned.directed import DirectedGraph
from ._lib.learned.rago import network
from ._lib.warm_up import Warm


@method(
    "rago",
    title="RAGO, reworked",
    cite="li2022, lee2022",
    requires=("scipy", "numba"),
    supervised=True,
    robust=True,
    simple_graph=True,
    invariant_to_deg=5e-4,
    frames_to_deg=None,  # it has learned how cameras are held
)
@dataclass(frozen=True)
class RAGO(Warm, Learned):
    """Minimises nothing: a network that has learned to lower a robust error of relative rotations, step by step.

    1. **Start**: the tree of `HARA`, whose edges triangles support.
    2. **Features** f of cameras and edges, and the first states h of their recurrent units: a layer of messages along
       edges that sees the measurements alone.
    3. `outer` times, an **edge update** and then four **camera updates**. The state of the graph is a rotation R_i of
       every camera and a rectified rotation E_ij of every edge in each direction, at first the measurement. A *cost
       graph* tells the differences between R_ij, E_ij and R_i R_j^T; three layers of messages read it; a gated
       recurrent unit takes what they read, and the features, into its state h.

       - Edge: from h of the edge six numbers in (0, 1) tell how far E_ij moves towards R_i R_j^T and R_ij, by axis.
       - Camera: one more layer, over what was read at edges and h of cameras, gives each edge three weights, by axis,
         and h of the camera the share of the step, at least a quarter. R_i turns by that share of the weighted mean of
         the differences of R_ij from R_i R_j^T, all cameras at once.

    The number of updates is fixed: none is chosen by what comes out.

    Source: Li, Cui, Liu and Tan, CVPR 2022: the two kinds of updates in turn, features, cost graph with three
    layers of messages, fusion, recurrent units, a loss on relative rotations that fades towards earlier updates, no
    gradient from one update to the next but through the states of the units. The authors give no weights. Deviations,
    all chosen on simulated graphs because two CPU cores learn in an hour what is easy to learn:

    - What edges and cameras are told and told to do is measured in the frame of a camera, so that nothing depends on
      the gauge: costs are differences with their sign, on a logarithmic scale; rotations R_i are no feature.
    - Units do not put out rotations but gates and weights of what the measurements ask for; the weights are those
      of the Geman-McClure loss at 1.1 degrees, times factors within e^-4 and e^4. Noise-free graphs are solved exactly.
    - 24 features for 48, MLPs of two layers for three and six: 41 thousand parameters for 255 thousand in the code.
    - E starts at the measurement, not at the identity, and its loss has the true rotation as its target, as in the
      paper (the code has another). The losses are log(1 + error / 0.6 degrees), means over edges.
    - The start is a tree by triangles, where the paper takes that of another network (CleanNet-SPT, from
      NeuRoRA), as nothing but the tree's quality is asked of it.
    - It is trained on simulated graphs, by three rounds of three camera updates (the paper: three of four), on at most
      2,500 edges of each in a step; the paper's five rounds of four are what is run.

    Updates are local: on long thin graphs, such as those of poses, twenty of them do not undo the drift of the tree.

    Parameters
    ----------
    outer
        Rounds of updates; the paper's t_g, 5 there (and 8 in its code).
    """

    outer: int = parameter(5, at_least=0)

    learns_from: ClassVar[tuple[str, ...]] = ("view-graph[noise=correlated,cameras=[40,60,80,120]]",)
    start: ClassVar[str] = "rago[outer=0]"

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        tree = supported_tree(problem, AllTriangles.of(problem), network.SUPPORT)
        graph = DirectedGraph.of(problem)
        found = network.solve(self.trained().arrays, graph, so3.to_quaternion(tree.rotations), self.outer)
        weights = np.empty(problem.m)
        either = found.weights.mean(axis=1)
        weights[graph.edge] = np.sqrt(either * either[graph.reverse])
        return Estimate(
            so3.from_quaternion(found.cameras),
            edge_weights=weights,
            iterations=self.outer * network.CAMERA_UPDATES,
            stop_reason="fixed number of updates",
            notes=(self.note(),),
        )

    def trainer(self, seed: int) -> Trainer:
        """What learns its weights."""
        from ._lib.learned.rago.training import trainer

        return trainer(seed)
