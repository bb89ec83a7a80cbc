"""Block coordinate descent on the semidefinite relaxation."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter

from ._lib.graph.confidence import confidence
from ._lib.linear.certificate import ROUNDING, chordal_cost, smallest_eigenvalue, weighted_blocks
from ._lib.linear.rounding import rounded
from ._lib.starts import Seeded, Start, start_rotations

if TYPE_CHECKING:
    from scipy import sparse

Init = Literal["identity", Start]
MIX = 0.01  # share of the identity in a start from rotations
DEFICIENT = 1e-12  # eigenvalues below it, relative to the largest, count as zero


@method(
    "bcd",
    title="BCD",
    cite="eriksson2018",
    requires=("scipy", "numba"),
    certifies=True,
    max_cameras=500,
    uses=("weights", "precisions"),
    exact_to_deg=1e-5,
    invariant_to_deg=0.1,  # the cameras take turns by label; it stops at a relative decrease of 1e-9
)
@dataclass(frozen=True)
class BCD(Seeded):
    """Minimises the sum of squared chordal residuals, R R^T relaxed to Y positive semidefinite, by blocks of Y.

    1. Y = I, or 0.99 R R^T + 0.01 I from the rotations of `init`. The diagonal blocks of Y (3n, 3n) stay identities.
    2. One epoch visits the cameras in order. With B the matrix Y without its k-th rows and columns and C the
       k-th block column of the measurements, the best k-th block column of Y is S = B C ((C^T B C)^(1/2))^+.
    3. Stop when an epoch lowers the relaxed cost by less than the tolerance, relative to that cost.
    4. Round: the three leading eigenvectors of Y, every block replaced by the nearest rotation.

    Source: Eriksson et al. 2018, algorithm 1 and lemma 5.1 for step 2. Deviations: none in the iteration. A
    start from rotations is mixed with the identity, because from Y = R R^T the rank would never grow and the
    iteration would be `rcd`. The certificate belongs to the rounded rotations. The terms
    are weighted by the `confidence` of the edges.

    Y is dense, and an epoch costs n products of a sparse (3, 3n) by a dense (3n, 3n) matrix.

    Parameters
    ----------
    init
        "identity", which favours no rotations, or a mixture with rotations, see `start_rotations`.
    tolerance
        Relative decrease of the relaxed cost in one epoch at which it ends.
    max_epochs
        Where it ends at the latest.
    max_cameras
        The largest problem it accepts.
    """

    init: Init = "identity"
    tolerance: float = parameter(1e-9, at_least=0)
    max_epochs: int = parameter(500, at_least=1)
    max_cameras: int = parameter(500, at_least=1)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        gram = np.eye(3 * problem.n)
        if self.init != "identity":
            columns = start_rotations(self.init, problem, rng).reshape(-1, 3)
            gram = MIX * gram + (1 - MIX) * columns @ columns.T
        measurements = weighted_blocks(problem)
        rows = [measurements[3 * k : 3 * k + 3] for k in range(problem.n)]
        cost = 6 * float(confidence(problem).sum()) - float(measurements.multiply(gram).sum())
        reason, epochs = "epoch limit", 0
        while epochs < self.max_epochs:
            gain = sum(_improved(gram, row, k) for k, row in enumerate(rows))
            cost -= gain
            epochs += 1
            if gain <= max(self.tolerance * cost, ROUNDING * problem.m):
                reason = f"decrease of the relaxed cost below {self.tolerance:g} of it"
                break
        rotations = rounded(gram)
        return Estimate(
            rotations,
            iterations=epochs,
            stop_reason=reason,
            cost=chordal_cost(problem, rotations),
            certificate=smallest_eigenvalue(problem, rotations),
        )


def _improved(gram: Floats, row: "sparse.csr_array", camera: int) -> float:
    """Replace the block row and column of a camera in `gram` by the best ones; by how much the cost falls.

    `row` (3, 3n) holds the measurements R_kj, so that its transpose is C, zero at the camera itself.
    """
    own = slice(3 * camera, 3 * camera + 3)
    product = row @ gram  # the transpose of B C, whose own block is not used
    before = (row.multiply(gram[own])).sum()
    product[:, own] = 0
    values, vectors = np.linalg.eigh((row @ product.T).T)
    kept = values > DEFICIENT * values[-1]
    roots = np.sqrt(values[kept])
    gram[own] = (vectors[:, kept] / roots) @ (vectors[:, kept].T @ product)
    gram[own, own] = np.eye(3)
    gram[:, own] = gram[own].T
    return float(2 * (roots.sum() - before))
