"""The semidefinite relaxation of rotation synchronization, modelled with cvxpy."""

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter

from ._lib.graph.confidence import confidence
from ._lib.linear.certificate import chordal_cost, multipliers, smallest_eigenvalue, weighted_blocks
from ._lib.linear.rounding import rounded
from ._lib.linear.spectral import spectral_rotations
from ._lib.warm_up import Warm

if TYPE_CHECKING:
    import cvxpy

USABLE = ("optimal", "optimal_inaccurate", "user_limit")  # cvxpy's statuses that come with a solution
# First balance of primal and dual residuals, which SCS adapts; its default of 0.1 suits this scaling badly.
SCS_SCALE = 10.0


@method(
    "sdp",
    title="SDP",
    cite="arienachimson2012",
    requires=("cvxpy", "scs", "scipy", "numba"),
    certifies=True,
    max_cameras=300,
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class SDP(Warm):
    """Minimises the sum of squared chordal residuals, with R R^T relaxed to a positive semidefinite matrix.

    1. Maximise tr(G X) over positive semidefinite X (3n, 3n) with identities as diagonal blocks; G holds
       R_ij, weighted, in block (i, j). What the solver gets is the dual: minimise tr(Lambda) over block-diagonal Lambda
       with Lambda - G positive semidefinite. It has 6n unknowns instead of 9n^2 / 2, and X is the multiplier
       of its one constraint.
    2. SCS starts from the spectral solution: X = R R^T, Lambda from the stationarity condition.
    3. Take the three leading eigenvectors of X scaled by the roots of their eigenvalues, change the sign of
       one when most of their blocks are reflections, and replace every block by the nearest rotation.

    Source: Arie-Nachimson et al. 2012, section 4 (the relaxation of Singer 2011 for SO(3)). Deviations: the
    dual form and the start, which change the time and not the optimum. The certificate belongs to the
    rounded rotations. The terms are weighted by the `confidence` of the edges.

    One SCS iteration is one eigendecomposition of a dense (3n, 3n) matrix. On one core the 227
    cameras of Ellis Island take half a minute, and a graph of 394 cameras took more than four.

    Parameters
    ----------
    solver
        ``scs``, first order; or ``clarabel``, an interior-point method, whose time and memory grow so fast
        that it is of use up to about 30 cameras.
    eps
        Absolute and relative tolerance of the solver. Rounding takes off most of what it leaves. A noise-free
        problem is solved by the start already; from random rotations, 20 cameras come within 1e-6 degrees
        with 1e-8.
    max_iterations
        Where it is reached, the estimate is what the solver had, and a note says so.
    max_cameras
        The largest problem it accepts.

    Raises
    ------
    RuntimeError
        When the solver ends without a solution.
    """

    solver: Literal["scs", "clarabel"] = "scs"
    eps: float = parameter(1e-5, above=0)
    max_iterations: int = parameter(2000, at_least=1)
    max_cameras: int = parameter(300, at_least=1)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        relaxation = _dual(problem)
        if self.solver == "scs":
            _solve_from_spectral(relaxation, problem, self.eps, self.max_iterations)
        else:
            _solve_by_clarabel(relaxation, self.eps, self.max_iterations)
        if relaxation.status not in USABLE:
            raise RuntimeError(f"{self.solver} ended without a solution; its status is '{relaxation.status}'")
        rotations = rounded(relaxation.constraints[0].dual_value)
        iterations = relaxation.solver_stats.num_iters
        notes: tuple[str, ...] = ()
        if relaxation.status != "optimal":
            notes = (f"{self.solver} did not reach eps={self.eps:g} in {iterations} iterations",)
        return Estimate(
            rotations,
            iterations=iterations,
            stop_reason=f"{self.solver}: {relaxation.status}",
            cost=chordal_cost(problem, rotations),
            certificate=smallest_eigenvalue(problem, rotations),
            notes=notes,
        )


def _dual(problem: Problem) -> "cvxpy.Problem":
    """Minimise tr(Lambda) with Lambda - G / (mean degree) positive semidefinite.

    The variable holds the lower triangles of the blocks of Lambda, camera by camera.
    """
    import cvxpy
    from scipy import sparse

    size = 3 * problem.n
    row, col = np.tril_indices(3)
    first = 3 * np.arange(problem.n)[:, None]
    rows, cols, unknown = (first + row).ravel(), (first + col).ravel(), np.arange(6 * problem.n)
    mirrored = rows != cols
    places = np.concatenate([rows + size * cols, (cols + size * rows)[mirrored]])
    columns = np.concatenate([unknown, unknown[mirrored]])
    spread = sparse.csr_array((np.ones(len(places)), (places, columns)), shape=(size**2, 6 * problem.n))
    triangles = cvxpy.Variable(6 * problem.n)
    blocks = cvxpy.reshape(spread @ triangles, (size, size), order="F")
    measurements = weighted_blocks(problem) / problem.degree.mean()
    return cvxpy.Problem(cvxpy.Minimize(cvxpy.sum(triangles[np.flatnonzero(~mirrored)])), [blocks - measurements >> 0])


def _solve_from_spectral(relaxation: "cvxpy.Problem", problem: Problem, eps: float, max_iterations: int) -> None:
    """Solve by SCS, called with cvxpy's data because cvxpy can only start it from its own last solution."""
    import cvxpy
    import scs

    data, chain, inverse = relaxation.get_problem_data(cvxpy.SCS)
    solver = scs.SCS(
        {name: data[name] for name in ("A", "b", "c")},
        {"s": list(data["dims"].psd)},
        eps_abs=eps,
        eps_rel=eps,
        max_iters=max_iterations,
        scale=SCS_SCALE,
        verbose=False,
    )
    rotations = spectral_rotations(problem, confidence(problem))[0]
    row, col = np.tril_indices(3)
    triangles = (multipliers(weighted_blocks(problem), rotations) / problem.degree.mean())[:, row, col].ravel()
    stacked = rotations.reshape(-1, 3)
    solution = solver.solve(
        warm_start=True,
        x=triangles,
        y=_packed(stacked @ stacked.T),
        s=data["b"] - data["A"] @ triangles,
    )
    with _status_checked_later():
        relaxation.unpack_results(solution, chain, inverse)


def _solve_by_clarabel(relaxation: "cvxpy.Problem", eps: float, max_iterations: int) -> None:
    with _status_checked_later():
        relaxation.solve(solver="CLARABEL", tol_gap_abs=eps, tol_gap_rel=eps, tol_feas=eps, max_iter=max_iterations)


def _status_checked_later() -> Any:
    """Silence the one warning of cvxpy that `SDP.solve` turns into a note."""
    return warnings.catch_warnings(action="ignore", category=UserWarning)


def _packed(symmetric: Floats) -> Floats:
    """Lower triangle of a matrix (N, N), column by column, off-diagonal entries times sqrt(2), as SCS wants it."""
    row, col = np.triu_indices(len(symmetric))
    return symmetric[row, col] * np.where(row == col, 1.0, np.sqrt(2))
