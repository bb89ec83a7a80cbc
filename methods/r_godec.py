"""R-GoDec: a matrix of rank three plus a sparse one, with missing blocks."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter

from ._lib.linear.rounding import nearest_rotations
from ._lib.linear.spectral import spectral_rotations
from ._lib.loops import edge_kernels
from ._lib.starts import TOLERANCE, Seeded, Start, start_rotations

SUBSPACE_STEPS = 2  # in each iteration, towards the best approximation of rank three
NOISE = 0.02  # deviation of the entries of the measured rotations that the published threshold assumes


@method(
    "r-godec",
    title="R-GoDec",
    cite="arrigoni2018",
    requires=("scipy", "numba"),
    robust=True,
    simple_graph=True,  # X has one block for each pair
    exact_to_deg=0.2,  # a hundred iterations do not complete a tree
    invariant_to_deg=0.01,  # entrywise thresholds
)
@dataclass(frozen=True)
class RGoDec(Seeded):
    """Minimises |P(X - L - S)|^2 / 2 + lambda |S|_1 over matrices L of rank three and sparse S.

    X (3n, 3n) holds R_ij in block (i, j), its transpose in block (j, i) and identities on the diagonal; P keeps those
    blocks. L stands for all R_i R_j^T, S for the outliers; where nothing was measured, X is free.

    1. Start from the three leading eigenvectors of X with zeros for what was not measured, or from `init`.
    2. S is X - L soft-thresholded by lambda on the measured blocks, and zero elsewhere.
    3. L is the best approximation of rank three to X - S, completed by the entries of the last L where nothing was
       measured.
    4. Repeat 2 and 3 until L stays where it is. The three leading eigenvectors of L, cut into one block
       for each camera, are projected to rotations; when most blocks are reflections, one eigenvector changes its sign.

    Sources: Arrigoni, Magri, Rossi, Fragneto and Fusiello, 3DV 2014, and Arrigoni, Rossi, Fragneto and
    Fusiello, CVIU 2018; lambda is 0.02 (2 log(9 k))^(1/2) for k measured blocks off the diagonal, the limit 100
    iterations. Deviations: the approximation of rank three is found by two steps of subspace iteration from the last
    one, where theirs is by bilateral random projections, so that nothing is random; it ends when L moves by less than
    the tolerance, since with noise the share of X that neither L nor S explains does not fall; rotations come from
    the eigenvectors, not from the block column of one camera. The completed matrix is L plus the measured residuals
    clipped to [-lambda, lambda], of which only the measured blocks are computed: nothing is (3n, 3n), and an
    iteration costs time proportional to the number of edges. It is a gradient step of length one on an entrywise Huber
    loss, and the less is measured, the slower it is. The weights of a problem are not used.

    Parameters
    ----------
    init
        Where to start: "zero-filled" (step 1), or the L of the rotations of `start_rotations`.
    threshold
        lambda; None: as published.
    iterations
        Limit.
    tolerance
        Frobenius norm of the change of L, relative to that of X.
    """

    init: Literal["zero-filled", Start] = "zero-filled"
    threshold: float | None = parameter(None, above=0)
    iterations: int = parameter(100, at_least=1)
    tolerance: float = parameter(1e-5, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        threshold = self.threshold or NOISE * float(np.sqrt(2 * np.log(18 * problem.m)))
        fitted = model(problem, self.init, threshold, rng)
        size = np.sqrt(3 * (2 * problem.m + problem.n))
        stop_reason, notes = "iteration limit", tuple[str, ...]()
        for iteration in range(1, self.iterations + 1):  # noqa: B007 - reported below
            moved = fitted.step() / size
            if moved <= self.tolerance:
                stop_reason = f"L changed by less than {self.tolerance:g}"
                break
        else:
            notes = (f"not converged: L still changed by {moved:.1e} in the last of {iteration} iterations",)
        return Estimate(
            fitted.rotations(),
            edge_weights=fitted.edge_weights(),
            iterations=iteration,
            stop_reason=stop_reason,
            cost=fitted.cost(),
            notes=notes,
        )


class Model:
    """L = basis core basis^T, with what of the measurements it leaves.

    `basis` (3n, 3) has orthonormal columns, `core` (3, 3) is symmetric.
    """

    def __init__(self, problem: Problem, threshold: float, basis: Floats, core: Floats) -> None:
        self._problem = problem
        self._threshold = threshold
        self._basis, self._core = np.ascontiguousarray(basis), core

    def step(self) -> float:
        """Replace L by the best approximation of rank three to its completion; how far it moved (Frobenius)."""
        basis = self._basis
        for _ in range(SUBSPACE_STEPS):
            basis = np.linalg.qr(self._completed(basis))[0]
        core = basis.T @ self._completed(basis)
        core = (core + core.T) / 2
        across = self._basis.T @ basis
        square = np.sum(core**2) + np.sum(self._core**2) - 2 * np.sum((across @ core @ across.T) * self._core)
        self._basis, self._core = basis, core
        return float(np.sqrt(max(square, 0.0)))

    def _completed(self, x: Floats) -> Floats:
        """Product (3n, 3) of L plus the clipped residuals with x (3n, 3)."""
        product = np.empty((self._problem.n, 3, 3))
        left, right = (self._basis @ self._core).reshape(-1, 3, 3), self._basis.reshape(-1, 3, 3)
        blocks = np.ascontiguousarray(x).reshape(-1, 3, 3)
        edge_kernels.clipped_product(
            self._problem.edges, self._problem.rotations, left, right, self._threshold, blocks, product
        )
        return product.reshape(-1, 3) + self._basis @ (self._core @ (self._basis.T @ x))

    def residuals(self) -> tuple[Floats, Floats]:
        """X - L in the measured blocks (m, 3, 3) of the edges and (n, 3, 3) of the diagonal."""
        i, j = self._problem.edges.T
        left = (self._basis @ self._core).reshape(-1, 3, 3)
        right = np.swapaxes(self._basis.reshape(-1, 3, 3), -1, -2)
        return self._problem.rotations - left[i] @ right[j], np.eye(3) - left @ right

    def rotations(self) -> Floats:
        """Rotations (n, 3, 3): the projected blocks of the eigenvectors of L."""
        return nearest_rotations(self._basis)

    def edge_weights(self) -> Floats:
        """Share (m,) of each residual that is left to noise: one where S is zero."""
        residuals, _ = self.residuals()
        norms = np.linalg.norm(residuals, axis=(1, 2))
        kept = np.linalg.norm(np.clip(residuals, -self._threshold, self._threshold), axis=(1, 2))
        return np.divide(kept, norms, out=np.ones_like(kept), where=norms > 0)

    def cost(self) -> float:
        """The objective, S being at its best for this L."""
        total = 0.0
        for residuals, times in zip(self.residuals(), (2, 1), strict=True):
            noise = np.clip(residuals, -self._threshold, self._threshold)
            total += times * float(0.5 * np.sum(noise**2) + self._threshold * np.abs(residuals - noise).sum())
        return total


def model(problem: Problem, init: str, threshold: float, rng: np.random.Generator) -> Model:
    """L of a start: of rank three, nearest to X with zeros filled in, or made of rotations."""
    if init != "zero-filled":
        rotations = start_rotations(init, problem, rng)  # type: ignore[arg-type]
        return Model(problem, threshold, rotations.reshape(-1, 3) / np.sqrt(problem.n), problem.n * np.eye(3))
    basis = spectral_rotations(problem, normalised=False, tolerance=TOLERANCE)[1].vectors
    core = basis.T @ (problem.block_matrix(diagonal=np.ones(problem.n)) @ basis)
    return Model(problem, threshold, basis, core)
