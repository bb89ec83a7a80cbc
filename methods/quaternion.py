"""Linear least squares on quaternions."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Floats, Problem, method, parameter, so3

from ._lib.graph.confidence import confidence
from ._lib.linear.eigen import PRECISE, Eigenspace, smallest
from ._lib.linear.laplacian import block_laplacian
from ._lib.starts import Start, Started, start_rotations

SIGNS_TOLERANCE = 1e-3  # radians, of the solutions that only choose signs

# Product of quaternions: (p q)_a = sum_bc PRODUCT[a, b, c] p_b q_c.
PRODUCT = np.zeros((4, 4, 4))
PRODUCT[0, 0, 0] = 1
for _axis in range(1, 4):
    _next, _last = _axis % 3 + 1, (_axis + 1) % 3 + 1
    PRODUCT[_axis, 0, _axis] = PRODUCT[_axis, _axis, 0] = PRODUCT[_axis, _next, _last] = 1
    PRODUCT[0, _axis, _axis] = PRODUCT[_axis, _last, _next] = -1


@method(
    "quaternion",
    title="Quaternion least squares",
    cite="govindu2001",
    requires=("scipy", "numba"),
    uses=("weights", "precisions"),
)
@dataclass(frozen=True)
class Quaternion(Started):
    """Minimises sum_ij w_ij |s_ij q_ij q_j - q_i|^2 over quaternions of unit norm in total and signs s_ij.

    The w_ij are the `confidence` of the edges.

    1. A rotation is two quaternions, q and -q, and the equations q_i = s_ij q_ij q_j are linear only once the signs
       are known: take those that fit the rotations of `init` better.
    2. Solve the homogeneous system in the least squares sense: a right singular vector of the smallest singular
       value, found as an eigenvector of the normal matrix, the graph Laplacian with -w_ij s_ij q_ij (as the 4 x 4
       matrix that multiplies from the left) in block (i, j). Multiplying all q_i from the right by one quaternion
       changes no residual: the value has multiplicity four, and all of its vectors are one answer in other gauges.
    3. Choose the signs anew by the solution and solve again, until no sign changes. No step increases the sum.
    4. Divide every q_i by its norm.

    Source: Govindu, CVPR 2001 (the linear system). Deviations: the choice of signs, steps 1 and 3, is ours; with
    ``sweeps=1`` they are those of the start. Eigenvectors are found by LAPACK up to 100
    cameras, else by block Davidson iterations (see `smallest`).

    As in `martinec-pajdla`, nothing bounds the norm of a single q_i, and a camera with few, contradicting measurements
    may take most of it.

    Parameters
    ----------
    init
        Rotations that the first signs agree with, see `start_rotations`.
    sweeps
        How often the system is solved at most.
    """

    init: Start = "spanning-tree"
    sweeps: int = parameter(50, at_least=1)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        measured = so3.to_quaternion(problem.rotations)
        cameras = so3.to_quaternion(start_rotations(self.init, problem, rng))
        signed, sweep, changed = _agreeing(problem, measured, cameras), 1, True
        while changed and sweep < self.sweeps:
            cameras = _solved(problem, signed, cameras, SIGNS_TOLERANCE).vectors[:, 0].reshape(-1, 4)
            previous, signed = signed, _agreeing(problem, signed, cameras)
            changed = not np.array_equal(signed, previous)
            sweep += 1
        found = _solved(problem, signed, cameras, PRECISE)
        cameras = found.vectors[:, 0].reshape(-1, 4)
        stop_reason = "sweep limit" if changed else "no sign changes"
        i, j = problem.edges.T
        cameras = cameras / np.linalg.norm(cameras, axis=1, keepdims=True)
        misfits = (_multiplied(signed, cameras[j]) - cameras[i]) ** 2
        cost = float(np.sum(confidence(problem)[:, None] * misfits))
        notes = () if found.error <= PRECISE else (f"eigenvectors known to {np.degrees(found.error):.1e} degrees only",)
        return Estimate(so3.from_quaternion(cameras), iterations=sweep, stop_reason=stop_reason, cost=cost, notes=notes)


def _agreeing(problem: Problem, measured: Floats, cameras: Floats) -> Floats:
    """The `measured` quaternions (m, 4), changed in sign where that brings them closer to `cameras` (n, 4)."""
    i, j = problem.edges.T
    disagrees = np.einsum("ea,ea->e", _multiplied(measured, cameras[j]), cameras[i]) < 0
    return np.where(disagrees[:, None], -measured, measured)


def _multiplied(p: Floats, q: Floats) -> Floats:
    """Products (k, 4) of quaternions (k, 4)."""
    return np.einsum("eac,ec->ea", _from_left(p), q)


def _solved(problem: Problem, signed: Floats, cameras: Floats, tolerance: float) -> Eigenspace:
    """The four eigenvectors of the smallest eigenvalue, from `cameras` (n, 4) in four gauges."""
    start = _from_left(cameras).reshape(-1, 4)
    return smallest(block_laplacian(problem, _from_left(signed)), start, tolerance)


def _from_left(p: Floats) -> Floats:
    """Matrices (k, 4, 4) that multiply quaternions by p (k, 4) from the left."""
    return np.einsum("abc,eb->eac", PRODUCT, p, optimize=True)
