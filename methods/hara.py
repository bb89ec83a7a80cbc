"""HARA: a spanning tree by the hierarchy of triplet support, an edge filter, and refinement."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Estimate, Floats, Problem, method, parameter, so3

from ._lib.descent.descent import Descent
from ._lib.descent.losses import LOSSES
from ._lib.graph.all_triangles import AllTriangles
from ._lib.graph.confidence import confidence
from ._lib.graph.hierarchical_tree import USUAL_ERROR, supported_tree
from ._lib.graph.restricted import restricted
from ._lib.graph.trees import tree_edges
from ._lib.graph.triangles import note_on_missing
from ._lib.warm_up import Warm


@method(
    "hara",
    title="HARA",
    cite="lee2022",
    requires=("scipy", "numba"),
    robust=True,
    simple_graph=True,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class HARA(Warm):
    """Minimises sum_ij sqrt(angle(R_i^T R_ij R_j)) over the edges that agree with a carefully grown spanning tree.

    1. List all triangles and their loop errors |R_ij R_jk - R_ik|^2 (Frobenius). The thresholds are the 10, 20 and
       30 % quantiles of the errors below 1. A triangle closes at a threshold when its error is not larger.
    2. Grow a tree from the camera of highest degree. An edge is the stronger, the more triangles at it close (up to
       `support`), and among equals the lower the threshold that they close at; the strongest edge that leaves the tree
       comes first. Where no triangle supports any such edge, the camera with the most neighbours in the tree gets the
       chordal L1 mean of what they predict.
    3. Remove the edges whose angle to the tree's prediction is `filter_deg` or more, unless the median loop error
       exceeds 1.
    4. One least squares step, then iteratively reweighted least squares with the L1/2 loss, as in `L1IRLS`.

    The hierarchical start is the method: there is no other `init`.

    Source: Lee and Civera, CVPR 2022, section 4 (algorithms 1 and 2), without the number of matches. Deviations: the
    thresholds are taken from all triangles, where the paper samples ten at each edge (on Ellis Island the three differ
    by 7 to 9 %), so that nothing is random; an edge's triangles are all counted, and once, where the paper looks for
    them as the tree grows; which of support and threshold is relaxed first is our reading: the threshold; the single
    rotation averaging is iterated on rotations; edges that the filter removes but that alone connect some camera are
    kept, those of smallest angle, and noted; in step 4 the terms are weighted by the `confidence` of the edges.

    Parameters
    ----------
    support
        Number of closing triangles above which an edge cannot be stronger; the paper's s_init.
    filter_deg
        The published limit is a Frobenius norm of 1, which is 41.4 degrees; 180 or more keeps all edges.
    irls_iterations
        Limit of step 4; 0 returns the tree.
    tolerance_deg
        Mean step at which it ends; the published 0.001 rad is 0.057 degrees.
    """

    support: int = parameter(10, at_least=1)
    filter_deg: float = parameter(41.4, above=0)
    irls_iterations: int = parameter(250, at_least=0)
    tolerance_deg: float = parameter(0.05, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        triangles = AllTriangles.of(problem)
        tree = supported_tree(problem, triangles, self.support)
        notes = [*note_on_missing(triangles.missing(problem.m), "no triplet supports them")]
        if tree.averaged:
            notes.append(f"cameras averaged for want of triplet support: {tree.averaged}")
        kept = np.ones(problem.m, dtype=np.bool_)
        if len(triangles.errors) and np.median(triangles.errors) > USUAL_ERROR:
            notes.append("no edge was filtered: most triangles are far from closing")
        else:
            residuals = problem.residuals(tree.rotations)
            kept = residuals < np.radians(self.filter_deg)
            bridges = _connecting(problem, residuals, kept)
            kept[bridges] = True
            if len(bridges):
                notes.append(f"edges kept beyond the filter to connect all cameras: {len(bridges)}")
        return self._refined(problem, tree.rotations, kept, tuple(notes))

    def _refined(self, problem: Problem, start: Floats, kept: NDArray[np.bool_], notes: tuple[str, ...]) -> Estimate:
        loss = LOSSES["l-half"]
        filtered = restricted(problem, kept)
        descent = Descent(filtered, start, np.radians(self.tolerance_deg))
        converged = False
        if self.irls_iterations:
            descent.step(confidence(filtered))
            converged = descent.reweight(loss, 1.0, self.irls_iterations)
        weights = np.zeros(problem.m)
        weights[kept] = descent.weights(loss, 1.0)
        return Estimate(
            so3.from_quaternion(descent.cameras),
            edge_weights=weights,
            iterations=descent.iterations,
            stop_reason=f"mean step below {self.tolerance_deg:g} degrees" if converged else "iteration limit",
            cost=float((confidence(filtered) * loss.value(descent.angles)).sum()),
            notes=notes,
        )


def _connecting(problem: Problem, residuals: Floats, kept: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Edges (k,) outside `kept` (m,), of the smallest residuals, that a connected graph needs beside those."""
    if restricted(problem, kept).components.max() == 0:
        return np.zeros(0, dtype=np.intp)
    tree = tree_edges(problem, 1 / (1 + residuals))
    return tree[~kept[tree]]
