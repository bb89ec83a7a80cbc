"""Two solutions of one graph, made into a better one piece by piece."""

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Problem, so3

from ..loops import edge_kernels

FAINT = 0.2  # agreement below which a camera that has still less loses little more
MOST_PIECES = 50
MEMBERS, ROUNDS = 100, 5  # of a search for the rotation that most cameras have in common
DIGITS = 6  # of a judgement; beyond, two are the same, lest rounding decide


class Judge:
    """How well the cameras of a solution agree with their edges, at one narrow scale (radians)."""

    def __init__(self, problem: Problem, scale: float) -> None:
        self.problem, self.scale = problem, scale
        self._measured = np.empty((problem.m, 4))
        edge_kernels.quaternions(problem.rotations, self._measured)

    def of_angles(self, angles: Floats) -> float:
        """Sum over the cameras of log(0.2 + sum over its edges of (1 + (r / h)^2)^-2), for residuals r (m,).

        The logarithm makes every camera count: one that agrees with nothing costs more than a hundred edges between
        cameras that agree already can bring.
        """
        agreement = 1 / (1 + (angles / self.scale) ** 2) ** 2
        i, j = self.problem.edges.T
        n = self.problem.n
        return round(float(np.log(FAINT + np.bincount(i, agreement, n) + np.bincount(j, agreement, n)).sum()), DIGITS)

    def of_cameras(self, cameras: Floats) -> float:
        """The same for quaternions (n, 4)."""
        vectors, angles = np.empty((self.problem.m, 3)), np.empty(self.problem.m)
        edge_kernels.edge_residuals(self.problem.edges, self._measured, cameras, vectors, angles)
        return self.of_angles(angles)


def recombined(judge: Judge, cameras: Floats, other: Floats, apart: float) -> tuple[Floats, int]:
    """`cameras` (n, 4) with the pieces of the `other` solution that the judge prefers, and how many these are.

    Two solutions of one graph differ by one rotation of the world and, on pieces of the graph, by another one: a piece
    is a connected set of cameras that stand more than `apart` (radians) from the other solution, neighbours turned by
    the same rotation up to that angle. The largest come first.
    """
    here, there = so3.from_quaternion(cameras), so3.from_quaternion(other)
    relative = np.swapaxes(here, -1, -2) @ there
    gauge = so3.from_quaternion(_most_common(so3.to_quaternion(relative), apart))
    moved = so3.to_quaternion(there @ gauge.T)
    taken, score, result = 0, judge.of_cameras(cameras), cameras
    for piece in _pieces(judge.problem, relative, gauge, apart)[:MOST_PIECES]:
        changed = result.copy()
        changed[piece] = moved[piece]
        if (better := judge.of_cameras(changed)) > score:
            taken, score, result = taken + 1, better, changed
    return result, taken


def _most_common(rotations: Floats, width: float) -> Floats:
    """Quaternion (4,) of the rotation that most of the `rotations` (n, 4) are near, up to a `width` in radians.

    A mode: the best of some members, moved to the mean of those around it. A median takes twenty times as long.
    """
    sine = np.sin(width / 2) ** 2
    members = rotations[np.unique(np.linspace(0, len(rotations) - 1, MEMBERS).astype(int))]
    cosines = rotations @ members.T
    found = members[np.argmax((1 / (1 + (1 - cosines**2) / sine) ** 2).sum(axis=0))]
    for _ in range(ROUNDS):
        cosines = rotations @ found
        found = (np.sign(cosines) / (1 + (1 - cosines**2) / sine) ** 2) @ rotations
        found = found / np.linalg.norm(found)
    return np.asarray(found)


def _pieces(problem: Problem, relative: Floats, gauge: Floats, apart: float) -> list[NDArray[np.intp]]:
    """Sets of cameras that stand elsewhere, the largest first; `relative` (n, 3, 3), `gauge` (3, 3)."""
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components

    elsewhere = so3.angle_between(relative, gauge) > apart
    i, j = problem.edges[elsewhere[problem.edges].all(axis=1)].T
    together = so3.angle_between(relative[i], relative[j]) < apart
    graph = sparse.coo_array((np.ones(together.sum()), (i[together], j[together])), shape=(problem.n, problem.n))
    labels = connected_components(graph, directed=False)[1]
    order = np.flatnonzero(elsewhere)[np.argsort(labels[elsewhere], kind="stable")]
    found = np.split(order, np.flatnonzero(np.diff(labels[order])) + 1) if len(order) else []
    return sorted(found, key=len, reverse=True)
