"""Graduated non-convexity, as GTSAM implements it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from bench import Estimate, Problem, method, parameter

from ._lib.descent.surrogates import SURROGATES, GncLoss
from ._lib.graph.confidence import confidence
from ._lib.gtsam_values import rotations_of, values_of
from ._lib.starts import Start, Started, start_rotations
from ._lib.stopwatch import Stopwatch

PRIOR_SIGMA = 1.0  # any; a prior on one camera fixes the gauge and costs nothing
INLIER_COST = 0.5  # GTSAM's cost of a residual at the threshold


@method(
    "gtsam-gnc",
    title="GNC (GTSAM)",
    cite="yang2020",
    requires=("gtsam", "scipy", "numba"),
    robust=True,
    depends_on_labels=True,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class GtsamGNC(Started):
    """Minimises the costs of `gnc`, each weighted problem by Levenberg-Marquardt.

    1. Start from `init`; a prior holds the first camera, known to be an inlier, where it starts.
    2. Solve with all weights 1 and choose mu from the largest residual.
    3. For each mu: weights from the residuals, then Levenberg-Marquardt from the start of 1 (not from the
       last solution).
    4. Stop when mu has reached 1 (Geman-McClure), the weights are all 0 or 1 (truncated least squares), or
       the cost changes by less than 1e-5 of it.

    Source: Yang, Antonante, Tzoumas and Carlone, RA-L 2020; GTSAM's GncOptimizer with its defaults.
    Deviations: `init`; the inner optimization ends by the relative decrease of its cost alone, because
    GTSAM's absolute limit stops small problems early. Nothing keeps a camera whose edges are all rejected
    from staying where it started.

    GTSAM's keys are camera-to-world rotations S_i = R_i^T with measurements S_i^T S_j, which is R_ij as it
    stands; its residual is the rotation vector, in units of the threshold divided by the
    root of the `confidence` of the edge: where `gnc` multiplies the loss, GTSAM knows only this way.

    Parameters
    ----------
    loss, threshold_deg
        As in `gnc`.
    init
        Where to start, see `start_rotations`.
    tolerance
        Relative decrease of the cost at which an inner optimization ends; the default is GTSAM's.
    """

    loss: GncLoss = "tls"
    threshold_deg: float = parameter(5.0, above=0)
    init: Start = "auto"
    tolerance: float = parameter(1e-5, above=0)

    @property
    def invariant_to_deg(self) -> float | None:
        """None: a camera whose edges are all rejected stays where damping and elimination, by label, have left it."""
        return None

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        import gtsam

        threshold = np.radians(self.threshold_deg)
        found = start_rotations(self.init, problem, rng)
        conversion = Stopwatch()
        with conversion.running():
            start = values_of(found)
            graph = _graph(problem, start, threshold)
        optimizer = gtsam.GncLMOptimizer(graph, start, self._parameters(prior=problem.m))
        optimizer.setInlierCostThresholds(INLIER_COST)
        values = optimizer.optimize()
        with conversion.running():
            rotations = rotations_of(values, problem.n)
            weights = np.array(optimizer.getWeights())[: problem.m]
        cost = SURROGATES[self.loss].cost(confidence(problem) * (problem.residuals(rotations) / threshold) ** 2).sum()
        return Estimate(
            rotations,
            edge_weights=confidence(problem) * weights,
            stop_reason="GTSAM does not tell",
            cost=float(cost),
            conversion_s=conversion.seconds,
        )

    def _parameters(self, prior: int) -> Any:
        import gtsam

        descent = gtsam.LevenbergMarquardtParams()
        descent.setRelativeErrorTol(self.tolerance)
        descent.setAbsoluteErrorTol(0.0)
        parameters = gtsam.GncLMParams(descent)
        parameters.setLossType(gtsam.GncLossType.TLS if self.loss == "tls" else gtsam.GncLossType.GM)
        parameters.setKnownInliers([prior])
        return parameters


def _graph(problem: Problem, start: Any, threshold: float) -> Any:
    """GTSAM's factor graph, the prior last: camera 0 as it starts. Residuals are in units of the threshold."""
    import gtsam

    graph = gtsam.NonlinearFactorGraph()
    sigmas = (threshold / np.sqrt(confidence(problem))).tolist()
    for (i, j), rotation, sigma in zip(problem.edges.tolist(), problem.rotations, sigmas, strict=True):
        noise = gtsam.noiseModel.Isotropic.Sigma(3, sigma)
        graph.add(gtsam.BetweenFactorRot3(i, j, gtsam.Rot3(rotation), noise))
    gauge = gtsam.noiseModel.Isotropic.Sigma(3, PRIOR_SIGMA)
    graph.add(gtsam.PriorFactorRot3(0, start.atRot3(0), gauge))
    return graph
