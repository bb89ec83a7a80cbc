"""Robust matrix completion by the nuclear norm: the convex counterpart of a rank constraint."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Estimate, Floats, Problem, method, parameter

from ._lib.linear.rounding import nearest_rotations
from ._lib.starts import Seeded, Start, start_rotations

SMALL = 60  # cameras; up to here LAPACK finds all eigenvectors fastest
EXTRA = 10  # columns beyond the current rank that are iterated
SUBSPACE_STEPS = 2  # in each iteration
ENTRY_STEP = 0.2  # threshold of an entry of E in one iteration, which sets the penalty


@method(
    "nuclear-norm",
    title="Nuclear norm",
    cite="candes2011",
    requires=("scipy", "numba"),
    robust=True,
    simple_graph=True,  # X has one block for each pair
    max_cameras=500,
    frames_to_deg=2.0,  # entrywise misfits: what turning does to two degrees of noise
)
@dataclass(frozen=True)
class NuclearNorm(Seeded):
    """Minimises |Z|_* + lambda |P(Z - X)|_1 over symmetric Z with Z_ii = I: singular values plus misfits, summed.

    X (3n, 3n) holds R_ij in block (i, j) and its transpose in block (j, i); P keeps those blocks. Z stands for all
    R_i R_j^T, of rank three. The program is convex: one optimal value, wherever it starts. Deep matrix
    factorization (`dmf-synch`) fits the same blocks and leaves the rank to its descent; here it is in the objective.

    1. Alternating directions with the splitting Z + E = X, E zero on the diagonal blocks and free where nothing was
       measured, multiplier Y and penalty mu: E is soft-thresholded by lambda / mu on the measured blocks; then the
       singular values of Z by 1 / mu; then Y grows by mu times what is left of X - Z - E.
    2. The three leading eigenvectors of Z, cut into one block for each camera, are projected to rotations;
       when most blocks are reflections, one eigenvector changes its sign.

    Sources: Candes, Li, Ma and Wright, JACM 2011, theorem 1.2 (the program, for a matrix of which only some entries are
    known and some of those are wrong); Lin, Chen and Ma 2010 (alternating directions). Deviations: the
    diagonal blocks, which are known, are constraints and not measurements; then |Z|_* >= trace Z = 3n, with equality
    for positive semidefinite Z alone, and a noise-free problem is solved exactly, however few its edges. lambda
    is `strength` / sqrt(p N), with N = 3n and p the share of entries that is measured; theirs has strength one,
    for data without noise. Random signs on the measured entries have a spectral norm near 2 sqrt(p N), so
    that up to strength 1/2 it does not pay to fit noise by singular values. The penalty is constant, 5 lambda, where
    theirs grows. Above 60 cameras singular values above 1 / mu are found by two steps of subspace
    iteration from the last ones, with ten columns to spare: exact only in the limit, as the iterates settle.
    The weights of a problem are not used.

    Misfits are those of single entries, as in the source and in `dmf-synch`, so that the answer depends a little on the
    frames of the cameras. All matrices are dense: half a minute at 500 cameras, which is what it is meant for at most.

    Parameters
    ----------
    strength
        Weight of the misfit; more strength, more rank.
    init
        The first Z is that of the rotations of `start_rotations`, the first Y the identity: optimal where they
        explain all measurements.
    iterations
        Limit.
    tolerance
        Of the primal and the dual residual, relative to the norms of X and of Y.
    """

    strength: float = parameter(0.5, above=0)
    init: Start = "spectral"
    iterations: int = parameter(200, at_least=1)
    tolerance: float = parameter(2e-3, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        program = Program(problem, self.strength, start_rotations(self.init, problem, rng))
        stop_reason = "iteration limit"
        for iteration in range(1, self.iterations + 1):  # noqa: B007 - reported below
            primal, dual = program.step()
            if max(primal, dual) <= self.tolerance:
                stop_reason = f"residuals below {self.tolerance:g}"
                break
        note = f"Z has rank {len(program.values)}; residuals {primal:.1e} (primal), {dual:.1e} (dual)"
        return Estimate(
            program.rotations(),
            edge_weights=program.edge_weights(),
            iterations=iteration,
            stop_reason=stop_reason,
            cost=program.cost(),
            notes=(note,),
        )


class Program:
    """The convex program of `NuclearNorm` and the iterates of its solution.

    Z is (vectors * values) @ vectors.T, with `vectors` (3n, rank) and `values` (rank,), of any sign.
    """

    def __init__(self, problem: Problem, strength: float, start: Floats) -> None:
        self._problem = problem
        self._measurements = problem.block_matrix(diagonal=np.ones(problem.n)).toarray()
        self._observed = _observed(problem)
        self.misfit_weight = strength / float(np.sqrt(self._observed.mean() * 3 * problem.n))
        self._penalty = self.misfit_weight / ENTRY_STEP
        self.vectors = start.reshape(-1, 3) / np.sqrt(problem.n)
        self.values = np.full(3, float(problem.n))
        self._basis = self.vectors
        self._z = (self.vectors * self.values) @ self.vectors.T
        self._multiplier = np.eye(3 * problem.n)

    def step(self) -> tuple[float, float]:
        """One round of alternating directions; relative norms of the primal and the dual residual."""
        scaled = self._measurements + self._multiplier / self._penalty
        excess = scaled - self._z
        excess -= np.where(self._observed, np.clip(excess, -ENTRY_STEP, ENTRY_STEP), 0.0)
        self._blocks_of(excess)[...] = 0
        previous = self._z
        self._threshold_values(scaled - excess)
        self._z = (self.vectors * self.values) @ self.vectors.T
        left = self._measurements - self._z - excess
        self._multiplier += self._penalty * left
        moved = self._penalty * float(np.linalg.norm(self._z - previous))
        multiplier = float(np.linalg.norm(self._multiplier))
        return float(np.linalg.norm(left) / np.linalg.norm(self._measurements)), moved / max(multiplier, 1e-300)

    def _blocks_of(self, matrix: Floats) -> Floats:
        """View (n, 3, 3) of the diagonal blocks of a matrix (3n, 3n)."""
        return np.einsum("iaib->iab", matrix.reshape(self._problem.n, 3, self._problem.n, 3))

    def _threshold_values(self, matrix: Floats) -> None:
        """Z of the `matrix` (3n, 3n), its singular values lessened by 1 / mu."""
        values, vectors = self._leading(matrix)
        sizes = np.abs(values) - 1 / self._penalty
        kept = sizes > 0
        self.vectors, self.values = vectors[:, kept], np.sign(values[kept]) * sizes[kept]

    def _leading(self, matrix: Floats) -> tuple[Floats, Floats]:
        """Eigenvalues and eigenvectors of the `matrix` (3n, 3n) that may be larger than 1 / mu."""
        size, width = len(matrix), len(self.values) + EXTRA
        if self._problem.n <= SMALL or 3 * width > size:
            return np.linalg.eigh(matrix)
        basis = np.concatenate([self._basis, matrix[:, : max(width - self._basis.shape[1], 0)]], axis=1)
        for _ in range(SUBSPACE_STEPS):
            basis = np.linalg.qr(matrix @ basis)[0]
        values, turn = np.linalg.eigh(basis.T @ matrix @ basis)
        largest = np.argsort(-np.abs(values), kind="stable")[:width]
        self._basis = basis @ turn[:, largest]
        return values[largest], self._basis

    def cost(self) -> float:
        """The objective at Z."""
        misfit = np.abs(self._z - self._measurements)[self._observed].sum()
        return float(np.abs(self.values).sum() + self.misfit_weight * misfit)

    def rotations(self) -> Floats:
        """Rotations (n, 3, 3): the projected blocks of the three leading eigenvectors of Z."""
        return nearest_rotations(self.vectors[:, np.argsort(-self.values, kind="stable")[:3]])

    def edge_weights(self) -> Floats:
        """Weight (m,) that reweighted least squares would give each edge: the inverse of its mean misfit in Z."""
        i, j = self._problem.edges.T
        blocks = self._z.reshape(self._problem.n, 3, self._problem.n, 3)[i, :, j]
        return 1 / np.maximum(np.abs(blocks - self._problem.rotations).mean(axis=(1, 2)), 1e-6)


def _observed(problem: Problem) -> NDArray[np.bool_]:
    """Mask (3n, 3n) of the measured blocks and of the diagonal."""
    cameras = np.eye(problem.n, dtype=bool)
    i, j = problem.edges.T
    cameras[i, j] = cameras[j, i] = True
    return np.repeat(np.repeat(cameras, 3, axis=0), 3, axis=1)
