"""The primal-dual method of Moreira, Marques and Costeira."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter, so3

from ._lib.graph.confidence import confidence, strengths
from ._lib.linear.certificate import (
    certificate_matrix,
    chordal_cost,
    multipliers,
    smallest_eigenvalue,
    weighted_blocks,
)
from ._lib.linear.eigen import smallest
from ._lib.linear.rounding import nearest_rotations
from ._lib.starts import Seeded, Start, start_rotations

if TYPE_CHECKING:
    from scipy import sparse

Init = Literal["degrees", Start]
SPREAD = 0.1  # random part of the columns that an eigenvector iteration starts from
ANGLE = 1e-6  # radians between the eigenvectors found and the true ones; values are good to the square of it
ROUNDING = 1e-12  # of the gap, for each edge


@method(
    "maks",
    title="MAKS",
    cite="moreira2021",
    requires=("scipy", "numba"),
    certifies=True,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class MAKS(Seeded):
    """Minimises the sum of squared chordal residuals by eigenvectors of Lambda - G, Lambda the multipliers.

    1. Lambda_i = degree of camera i times the identity, or the multipliers at `init`. G holds R_ij in block (i, j).
    2. R: the eigenvectors of the three smallest eigenvalues of Lambda - G, every block replaced by the
       nearest rotation.
    3. Lambda_i: the symmetric part of sum_j R_ij Q_j Q_i^T, where Q_i is the rotation nearest to
       sum_j R_ij R_j.
    4. Repeat until the gap between the cost of R and the bound of the relaxation,
       2 * 3m - tr(Lambda) + 3n lambda_min, is below the tolerance.

    Source: Moreira et al., ICCV 2021, algorithm 1, and the authors' public code. Deviations:

    - Step 3 takes Q for R with `update=published`. That iteration is not stable on hard scenes: on Ellis
      Island the cost is lowest after two iterations and then grows, on Madrid Metropolis it ends 3 % above
      the optimum. With the rotations moved first it converges on all scenes tried.
    - They stop when the smallest eigenvalue is below 5e-14. The gap bounds the error of the cost instead.
    - The eigenvectors are those of the smallest eigenvalues, theirs of the nearest to zero; how they are
      found see `smallest` (theirs: Krylov-Schur iterations on a shifted factorization).
    - The estimate is the R of lowest cost, not the last; no camera is turned to the identity.

    The terms are weighted by the `confidence` of the edges: R_ij stands for w_ij R_ij in G and in step 3, and degrees
    are sums of the w.

    Parameters
    ----------
    init
        "degrees", the published start, whose first R is the connection Laplacian's solution; or rotations,
        see `start_rotations`.
    update
        Where the multipliers are taken: at rotations "projected" once more, or at R as "published".
    tolerance
        Gap, relative to the cost, at which it ends: an upper bound on how far the cost is above the minimum.
    max_iterations
        Where it ends at the latest; the published number.
    """

    init: Init = "degrees"
    update: Literal["projected", "published"] = "projected"
    tolerance: float = parameter(1e-8, at_least=0)
    max_iterations: int = parameter(50, at_least=1)

    @property
    def invariant_to_deg(self) -> float | None:
        """From a poor start it may not have converged at the iteration limit."""
        return 1e-3 if self.init in ("degrees", "spectral") else None

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        measurements = weighted_blocks(problem)
        most = 6 * float(confidence(problem).sum())
        noise = SPREAD * np.random.default_rng(0).standard_normal((3 * problem.n, 3))
        if self.init == "degrees":
            dual, columns = strengths(problem)[:, None, None] * np.eye(3), noise
        else:
            first = start_rotations(self.init, problem, rng)
            dual, columns = self._updated(measurements, first), first.reshape(-1, 3) + noise
        best, lowest, reason, iterations = np.empty(0), np.inf, "iteration limit", 0
        while iterations < self.max_iterations:
            found = smallest(certificate_matrix(measurements, dual), columns, ANGLE)
            rotations = nearest_rotations(found.vectors)
            iterations += 1
            cost = chordal_cost(problem, rotations)
            if cost < lowest:
                best, lowest = rotations, cost
            bound = most - np.trace(dual, axis1=1, axis2=2).sum() + 3 * problem.n * found.values[0]
            if lowest - bound <= max(self.tolerance * lowest, ROUNDING * problem.m):
                reason = f"gap below {self.tolerance:g} of the cost"
                break
            dual, columns = self._updated(measurements, rotations), rotations.reshape(-1, 3) + noise
        return Estimate(
            best,
            iterations=iterations,
            stop_reason=reason,
            cost=lowest,
            certificate=smallest_eigenvalue(problem, best),
        )

    def _updated(self, measurements: "sparse.csr_array", rotations: Floats) -> Floats:
        """Multipliers (n, 3, 3) of step 3."""
        if self.update == "projected":
            rotations = so3.project((measurements @ rotations.reshape(-1, 3)).reshape(-1, 3, 3))
        return multipliers(measurements, rotations)
