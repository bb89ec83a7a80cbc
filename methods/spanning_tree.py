"""Rotations propagated along a spanning tree."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Problem, method

from ._lib.graph.confidence import ranking
from ._lib.graph.trees import propagated, tree_edges


@method("spanning-tree", title="Spanning tree", requires=("scipy",), uses=("weights", "precisions"))
@dataclass(frozen=True)
class SpanningTree:
    """Fits n - 1 edges exactly and ignores the rest; the usual start of local methods.

    1. Choose the tree: of largest total weight where the measurements come with weights (such as match counts) or
       precisions;
       otherwise breadth first from the camera of highest degree, every camera hanging from its neighbour of
       highest degree one level up.
    2. Propagate R_i = R_ij R_j from the root, one depth of the tree at a time.

    Ties of weight or degree go to the smaller angle of the measurement, then to the lower index. The tree
    therefore does not depend on labels, edge order or edge direction as long as no two angles are equal to
    the last bit.
    """

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        tree = tree_edges(problem, ranking(problem))
        chosen = np.zeros(problem.m)
        chosen[tree] = 1
        return Estimate(propagated(problem, tree), edge_weights=chosen, stop_reason="every camera reached")
