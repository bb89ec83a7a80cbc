"""L1-IRLS: robust rotation averaging in the tangent space."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Problem, method, parameter, so3

from ._lib.descent.descent import Descent
from ._lib.descent.losses import LOSSES, LossName
from ._lib.graph.confidence import confidence, has_counts
from ._lib.starts import Start, Started, resolved, start_rotations


@method(
    "l1-irls",
    title="L1-IRLS",
    cite="chatterjee2018",
    requires=("scipy", "numba"),
    robust=True,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class L1IRLS(Started):
    """Minimises sum_ij c_ij loss(angle(R_i^T R_ij R_j)) by a sequence of weighted least squares problems.

    The c_ij are the `confidence` of the edges, by which the weights w_ij of all steps are multiplied.

    With R_i <- R_i exp(x_i) an edge asks for x_i - x_j = b_ij, where exp(b_ij) = R_i^T R_ij R_j. Each
    iteration minimises sum_ij w_ij |x_i - x_j - b_ij|^2 (one factorization of a weighted graph Laplacian
    for the three columns of x; on large graphs conjugate gradients, to a relative residual of 0.03, see
    `LaplacianSolver`) and moves all cameras.

    1. Start from `init`.
    2. L1 stage: w_ij = 1 / |b_ij|, until the mean step is below the tolerance. After a spanning tree one
       step with w_ij = 1 comes first: its own edges have no residual, and would hold everything in place. After the
       tree of largest match counts there is no L1 stage: a tree of good edges is better than where L1 leads.
    3. Second stage: w_ij = loss'(|b_ij|) / |b_ij|, until the mean step is below the tolerance.

    Sources: Chatterjee and Govindu, ICCV 2013 (L1RA and L1-IRLS) and PAMI 2018 (the other losses; with
    Geman-McClure, whose weight is sigma^2 / (b^2 + sigma^2)^2). Deviations: the L1 problem is solved by
    reweighting, with a new linearisation each time, where theirs runs two interior-point iterations of
    l1-magic for each; its l1 norm is that of the vectors b_ij, not of their coordinates, so that the answer
    does not depend on the gauge; the residuals of the second stage are those of the moved cameras, not of
    the linear system, and its first pass is weighted; the mean step is removed instead of anchoring a
    camera; the default start is spectral, theirs a spanning tree; weights are kept above 1e-10 of the
    largest, so that losses that reject edges cannot disconnect the graph; a step more than half as long as
    the one before is lengthened by half (the weighted problem majorises the loss, so that any factor below two
    descends; a quarter of the iterations was saved on real scenes).

    Parameters
    ----------
    sigma_deg
        Scale of the noise; each loss multiplies it by its own tuning constant. l1, l1.5, l2 and
        l-half have no scale.
    loss
        Loss of the second stage.
    init
        Where to start, see `start_rotations`.
    l1_iterations, irls_iterations
        Limits of the two stages.
    tolerance_deg
        Mean step at which a stage ends; the default is the published 0.001 rad.
    """

    sigma_deg: float = parameter(5.0, above=0)
    loss: LossName = "geman-mcclure"
    init: Start = "auto"
    l1_iterations: int = parameter(10, at_least=0)
    irls_iterations: int = parameter(100, at_least=0)
    tolerance_deg: float = parameter(0.057, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        loss, sigma = LOSSES[self.loss], np.radians(self.sigma_deg)
        descent = Descent(problem, start_rotations(self.init, problem, rng), np.radians(self.tolerance_deg))
        from_tree = resolved(self.init, problem) == "spanning-tree"
        from_counts = from_tree and has_counts(problem)
        if not from_counts:
            if from_tree:
                descent.step(confidence(problem))
            descent.reweight(LOSSES["l1"], 1.0, self.l1_iterations)
        converged = descent.reweight(loss, loss.scale(sigma), self.irls_iterations)
        return Estimate(
            so3.from_quaternion(descent.cameras),
            edge_weights=descent.weights(loss, loss.scale(sigma)),
            iterations=descent.iterations,
            stop_reason=f"mean step below {self.tolerance_deg:g} degrees" if converged else "iteration limit",
            cost=float((confidence(problem) * loss.value(descent.angles / loss.scale(sigma))).sum()),
            notes=("no L1 stage: it started at the tree of largest match counts",) if from_counts else (),
        )
