"""Theia's robust rotation averaging, through pytheia."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter, so3

from ._lib.starts import Start, Started, start_rotations
from ._lib.stopwatch import Stopwatch


@method(
    "theia",
    title="Theia",
    cite="chatterjee2013, sweeney2015",
    requires=("pytheia", "scipy", "numba"),
    install="python -m pip install 'pytheia>=1.2' (Linux on x86-64 only)",
    robust=True,
    depends_on_labels=True,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class Theia(Started):
    """Minimises a sum of robust functions of geodesic residuals: an L1 stage, then reweighted least squares.

    1. Start from `init`.
    2. At most 5 linearised L1 steps, each by at most 5, 10, 20, 40 and 80 iterations of ADMM.
    3. At most 100 reweighted least squares steps with weights sigma / (e^2 + sigma^2)^2.

    Both stages end at a mean step of 1e-3 radians.

    Sources: the RobustRotationEstimator of Theia (Sweeney et al. 2015), after Chatterjee and Govindu 2013, with its
    defaults. By default it starts as Theia's pipeline does, at a maximum spanning tree by match counts; weights rank
    the edges of that tree and are not used otherwise. Its other estimators (nonlinear, linear, Lagrange dual, hybrid)
    are left out: pytheia 1.2 hands their answers to a copy of its argument, so that they do not reach Python.

    Theia takes R_j R_i^T, the transpose of R_ij, as a rotation vector for the edge from i to j, and R_i as it stands.
    One camera, by its hash table, is held where it starts. It does not tell whether a factorization failed.

    Parameters
    ----------
    sigma_deg
        Scale of the weights.
    init
        Where to start, see `start_rotations`.

    Raises
    ------
    RuntimeError
        When Theia returns what is no rotation.
    """

    sigma_deg: float = parameter(5.0, above=0)
    init: Start = "spanning-tree"

    @property
    def invariant_to_deg(self) -> float | None:
        """None: its L1 norm is that of coordinates, in the frame of a camera that the labels choose."""
        return None

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        start = start_rotations(self.init, problem, rng)
        conversion = Stopwatch()
        with conversion.running():
            estimator, vectors = self._estimator(problem), dict(enumerate(so3.log(start)))
        # The edges were added one by one; a map of view pairs, empty here, could not hold parallel ones.
        found = estimator.EstimateRotations({}, vectors)
        with conversion.running():
            rotations = so3.exp(np.array([found[camera] for camera in range(problem.n)]).reshape(problem.n, 3))
        if not np.isfinite(rotations).all():
            raise RuntimeError("Theia's robust rotation estimator returned values that are not finite")
        return Estimate(rotations, stop_reason="Theia does not tell", conversion_s=conversion.seconds)

    def _estimator(self, problem: Problem) -> Any:
        """Theia's estimator, with all edges."""
        import pytheia

        options = pytheia.sfm.RobustRotationEstimatorOptions()
        options.irls_loss_parameter_sigma = np.radians(self.sigma_deg)
        estimator = pytheia.sfm.RobustRotationEstimator(options)
        for (i, j), vector in zip(problem.edges.tolist(), _transposed(problem.rotations), strict=True):
            estimator.AddRelativeRotationConstraint((i, j), vector)
        return estimator


def _transposed(rotations: Floats) -> Floats:
    """Rotation vectors (m, 3) of the transposes of R_ij (m, 3, 3)."""
    return so3.log(np.swapaxes(rotations, -1, -2))
