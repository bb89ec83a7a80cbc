"""Shonan rotation averaging, as GTSAM implements it."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from bench import Estimate, Problem, method, parameter

from ._lib.graph.confidence import confidence
from ._lib.gtsam_values import rotations_of, values_of
from ._lib.linear.certificate import certified, chordal_cost, smallest_eigenvalue
from ._lib.linear.spectral import spectral_rotations
from ._lib.stopwatch import Stopwatch
from ._lib.warm_up import Warm

HUBER = 1.345  # GTSAM's threshold, in units of sigma


@method(
    "shonan",
    title="Shonan",
    cite="dellaert2020",
    requires=("gtsam", "scipy", "numba"),
    certifies=True,
    invariant_to_deg=0.1,  # it stops at a relative decrease of 1e-7
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class Shonan(Warm):
    """Minimises the sum of squared (or Huber) chordal residuals on SO(p), from p = 3 upward until certified.

    1. Levenberg-Marquardt on SO(3) from the spectral solution.
    2. With the squared loss: where the smallest eigenvalue of the certificate matrix is negative, follow its
       eigenvector to SO(p + 1), optimise there, and so on up to p_max; round to SO(3). With the Huber loss
       there is no certificate, and GTSAM demands one p: 3.

    Source: Dellaert et al. 2020; GTSAM's ShonanAveraging3 with its defaults (Ceres-like Levenberg-Marquardt,
    conjugate gradients with a block-Jacobi preconditioner, a soft Karcher-mean gauge). Deviations:

    - The start. GTSAM draws random rotations from one generator per process, so that its result would depend
      on what ran before; for the squared loss the certificate makes the start irrelevant.
    - The staircase begins at p = 3. GTSAM lifts a start on SO(3) to SO(p) by padding with the identity,
      where the gradient along the new directions is zero: a higher first p takes the same path more slowly.
    - Levenberg-Marquardt ends at a relative decrease of 1e-7, GTSAM's at 1e-6.
    - `Estimate.certificate` is recomputed for the rounded rotations, because GTSAM's own is found to 1e-3
      only, from a random vector.

    GTSAM's keys are camera-to-world rotations S_i = R_i^T with measurements S_i^T S_j, which is R_ij as it
    stands. A measurement has the deviation sigma / sqrt(w_ij), w being the `confidence` of the edges: squares are
    multiplied by w, and where the Huber loss is linear, residuals are by its root.

    Parameters
    ----------
    loss
        ``l2``, which can be certified, or ``huber``, which is robust.
    sigma_deg
        Unit of the Huber loss. The residual is chordal, |R_ij - R_i R_j^T|_F = 2 sqrt(2) sin(angle / 2), and
        counts linearly above 1.345 sigma: with 5, above 4.76 degrees. Without effect on ``l2``.
    p_max
        Where the staircase ends.
    tolerance
        Relative decrease of the cost at which Levenberg-Marquardt ends. With 1e-6, GTSAM's for Ceres-like
        parameters, the cost on Ellis Island is 1.7e-6 above the optimum, with 1e-7 1.5e-7.
    """

    loss: Literal["l2", "huber"] = "l2"
    sigma_deg: float = parameter(5.0, above=0)
    p_max: int = parameter(10, at_least=3)
    tolerance: float = parameter(1e-7, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        return self._huber(problem) if self.loss == "huber" else self._l2(problem)

    def _l2(self, problem: Problem) -> Estimate:
        found = spectral_rotations(problem, confidence(problem))[0]
        conversion = Stopwatch()
        with conversion.running():
            start, measurements = values_of(found), _measurements(problem, sigma=1.0)
        notes: tuple[str, ...] = ()
        try:
            values, _ = self._averaging(measurements, certify=True).run(start, 3, self.p_max)
            reason = "certified by GTSAM"
        except RuntimeError as error:
            if "did not converge" not in str(error):
                raise
            values, _ = self._averaging(measurements, certify=False).run(start, 3, 3)
            reason = "local optimum on SO(3)"
            notes = (f"not certified up to p={self.p_max}: a local optimum on SO(3) is returned",)
        with conversion.running():
            rotations = rotations_of(values, problem.n)
        certificate = smallest_eigenvalue(problem, rotations)
        if not notes and not certified(problem, certificate):
            reason = "optimum of the relaxation"
            notes = (f"not certified: rounding to SO(3) leaves a smallest eigenvalue of {certificate:.1e}",)
        return Estimate(
            rotations,
            stop_reason=reason,
            cost=chordal_cost(problem, rotations),
            certificate=certificate,
            conversion_s=conversion.seconds,
            notes=notes,
        )

    def _huber(self, problem: Problem) -> Estimate:
        sigma, weights = np.radians(self.sigma_deg), confidence(problem)
        found = spectral_rotations(problem, confidence(problem))[0]
        conversion = Stopwatch()
        with conversion.running():
            start, measurements = values_of(found), _measurements(problem, sigma)
        values, _ = self._averaging(measurements, certify=False).run(start, 3, 3)
        with conversion.running():
            rotations = rotations_of(values, problem.n)
        residual = 2 * np.sqrt(2) * np.sin(problem.residuals(rotations) / 2) / sigma * np.sqrt(weights)
        cost = np.where(residual <= HUBER, 0.5 * residual**2, HUBER * (residual - 0.5 * HUBER)).sum()
        return Estimate(
            rotations,
            edge_weights=weights * HUBER / np.maximum(residual, HUBER),
            stop_reason="local optimum on SO(3)",
            cost=float(cost),
            conversion_s=conversion.seconds,
        )

    def _averaging(self, measurements: list[Any], *, certify: bool) -> Any:
        import gtsam

        descent = gtsam.LevenbergMarquardtParams.CeresDefaults()
        descent.setRelativeErrorTol(self.tolerance)
        parameters = gtsam.ShonanAveragingParameters3(descent)
        parameters.setUseHuber(self.loss == "huber")
        parameters.setCertifyOptimality(certify)
        return gtsam.ShonanAveraging3(measurements, parameters)


def _measurements(problem: Problem, sigma: float) -> list[Any]:
    """GTSAM's measurements; sigma is the standard deviation of a chordal residual of an edge of confidence one."""
    import gtsam

    sigmas = (sigma / np.sqrt(confidence(problem))).tolist()
    noises = {value: gtsam.noiseModel.Isotropic.Sigma(3, value) for value in set(sigmas)}
    return [
        gtsam.BinaryMeasurementRot3(i, j, gtsam.Rot3(rotation), noises[value])
        for (i, j), rotation, value in zip(problem.edges.tolist(), problem.rotations, sigmas, strict=True)
    ]
