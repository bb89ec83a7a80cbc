"""The spanning tree of HARA: the edges with the strongest triplet support first."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints, Problem, so3

from ..loops.edge_kernels import compiled
from .all_triangles import AllTriangles

QUANTILES = (0.1, 0.2, 0.3)
USUAL_ERROR = 1.0  # squared Frobenius norm, 41.4 degrees; larger loop errors tell nothing of the noise
ROUNDING = 1e-12  # of a squared Frobenius norm
MEDIAN_ITERATIONS = 10
MEDIAN_TOLERANCE = 1e-3  # radians
NEAREST = 1e-9  # keeps the weight of a rotation that the median meets finite


@dataclass(frozen=True)
class Tree:
    """Rotations (n, 3, 3), and how many cameras were `averaged` because no triplet supported an edge to them."""

    rotations: Floats
    averaged: int


def supported_tree(problem: Problem, triangles: AllTriangles, support: int) -> Tree:
    """The tree of steps 1 and 2 of `HARA`: `support` triangles are as good as more."""
    usual = triangles.errors[triangles.errors < USUAL_ERROR]
    thresholds = np.maximum(np.quantile(usual, QUANTILES), ROUNDING) if len(usual) else np.zeros(0)
    levels = support_levels(problem, triangles, thresholds, support)
    return hierarchical_tree(problem, levels, support * len(thresholds))


def support_levels(problem: Problem, triangles: AllTriangles, thresholds: Floats, most: int) -> Ints:
    """(m,) rank of each edge, 0 for the best supported.

    An edge has rank (most - s) * k + q when s of its triangles, or more where s = `most`, have an error of at most
    thresholds[q], k being the number of thresholds; the lowest such rank counts. Without any it is most * k.
    """
    count = len(thresholds)
    levels = np.full(problem.m, most * count)
    for q, threshold in enumerate(thresholds):
        support = np.minimum(triangles.support(triangles.errors <= threshold, problem.m), most)
        levels = np.where(support > 0, np.minimum(levels, (most - support) * count + q), levels)
    return levels.astype(np.int32)


def hierarchical_tree(problem: Problem, levels: Ints, lost: int) -> Tree:
    """Grow a tree from the camera of highest degree, along edges of the lowest possible of `levels` (m,).

    Of the cameras that can branch out at that level, the one with the most neighbours outside the tree does, to all of
    them that the level reaches. Where all edges that leave the tree are at level `lost`, the outside camera with the
    most neighbours inside gets the chordal L1 mean of what they predict. Ties go to the camera of higher degree, then
    to the smaller sum of measured angles.
    """
    growth = _Growth(problem, levels, lost)
    averaged = 0
    while growth.grow() < problem.n:
        growth.add_averaged()
        averaged += 1
    return Tree(so3.from_quaternion(growth.cameras), averaged)


class _Growth:
    """The tree as far as it has grown; `cameras` (n, 4) are unit quaternions."""

    def __init__(self, problem: Problem, levels: Ints, lost: int) -> None:
        n, m = problem.n, problem.m
        angles = np.bincount(problem.edges.ravel(), np.repeat(so3.angle(problem.rotations), 2))
        by_preference = np.lexsort((angles, -problem.degree))
        self._preference = np.empty(n, dtype=np.int32)
        self._preference[by_preference] = np.arange(n)
        i, j = problem.edges.T
        ends, others, ids = np.concatenate([i, j]), np.concatenate([j, i]), np.tile(np.arange(m, dtype=np.int32), 2)
        order = np.lexsort((self._preference[others], levels[ids], ends))
        self._other, self._ids = others[order].astype(np.int32), ids[order]
        self._levels = np.ascontiguousarray(levels[self._ids])
        self._first = np.concatenate([[0], np.cumsum(problem.degree)]).astype(np.int32)
        self._measured, self._lost = so3.to_quaternion(problem.rotations), lost
        self._pointer, self._outside = self._first[:-1].copy(), problem.degree.copy()
        self._order, self._inside = np.empty(n, dtype=np.int32), np.zeros(n, dtype=np.bool_)
        self._count = np.zeros(1, dtype=np.int32)
        self.cameras = np.zeros((n, 4))
        self._add(int(by_preference[0]), np.array([1.0, 0.0, 0.0, 0.0]))

    def grow(self) -> int:
        """Add cameras as long as an edge with support leaves the tree; the number of cameras in it."""
        grow_tree(
            self._first, self._other, self._ids, self._levels, self._lost, self._preference, self._measured,
            self._pointer, self._outside, self._inside, self._order, self._count, self.cameras,
        )  # fmt: skip
        return int(self._count[0])

    def add_averaged(self) -> None:
        """Add the outside camera with the most neighbours inside, at the mean of what they predict."""
        neighbours = np.where(self._inside, -1, np.diff(self._first) - self._outside)
        best = np.flatnonzero(neighbours == neighbours.max())
        camera = int(best[np.argmin(self._preference[best])])
        row = slice(self._first[camera], self._first[camera + 1])
        known = self._inside[self._other[row]]
        others, measured = self._other[row][known], so3.from_quaternion(self._measured[self._ids[row][known]])
        outward = np.where((others > camera)[:, None, None], measured, np.swapaxes(measured, -1, -2))
        mean = chordal_l1_mean(outward @ so3.from_quaternion(self.cameras[others]))
        self._add(camera, so3.to_quaternion(mean))

    def _add(self, camera: int, quaternion: Floats) -> None:
        self.cameras[camera] = quaternion
        self._inside[camera] = True
        self._order[self._count[0]] = camera
        self._count += 1
        self._outside[self._other[self._first[camera] : self._first[camera + 1]]] -= 1


@compiled
def grow_tree(
    first: Ints,
    other: Ints,
    ids: Ints,
    levels: Ints,
    lost: int,
    preference: Ints,
    measured: Floats,
    pointer: Ints,
    outside: Ints,
    inside: NDArray[np.bool_],
    order: Ints,
    count: Ints,
    cameras: Floats,
) -> None:
    """Grow a tree until no edge below level `lost` leaves it.

    Parameters
    ----------
    first, other, ids, levels
        (n + 1,) and (2m,): the neighbours of each camera by ascending level, the edge that leads there, and its level.
    preference
        (n,) all different; the lower one wins a tie.
    measured
        (m, 4) unit quaternions of R_ij.
    pointer, outside, inside, order, count, cameras
        The state, updated: where the neighbours begin that may be outside, how many are; which cameras are in the
        tree, in which order they came, how many they are (1,), and their quaternions.
    """
    while True:
        base, lowest = -1, lost
        for f in range(count[0]):
            camera = order[f]
            while pointer[camera] < first[camera + 1] and inside[other[pointer[camera]]]:
                pointer[camera] += 1
            if pointer[camera] == first[camera + 1] or levels[pointer[camera]] >= lost:
                continue
            level = levels[pointer[camera]]
            if (
                base < 0
                or level < lowest
                or (level == lowest and outside[camera] > outside[base])
                or (level == lowest and outside[camera] == outside[base] and preference[camera] < preference[base])
            ):
                base, lowest = camera, level
        if base < 0:
            return
        for p in range(pointer[base], first[base + 1]):
            camera = other[p]
            if levels[p] != lowest:
                break
            if inside[camera]:
                continue
            # R_camera = R_camera,base R_base; the measurement is stored from the lower camera to the higher.
            sign = 1.0 if camera < base else -1.0
            w, x, y, z = measured[ids[p]]
            x, y, z = sign * x, sign * y, sign * z
            a, b, c, d = cameras[base]
            cameras[camera, 0] = w * a - x * b - y * c - z * d
            cameras[camera, 1] = w * b + x * a + y * d - z * c
            cameras[camera, 2] = w * c - x * d + y * a + z * b
            cameras[camera, 3] = w * d + x * c - y * b + z * a
            inside[camera] = True
            order[count[0]] = camera
            count[0] += 1
            for q in range(first[camera], first[camera + 1]):
                outside[other[q]] -= 1


def chordal_l1_mean(rotations: Floats) -> Floats:
    """Rotation (3, 3) near the matrix with the smallest sum of Frobenius distances to `rotations` (k, 3, 3).

    Weiszfeld's iteration on matrices from their entry-wise median, each time replaced by the nearest rotation.
    """
    mean = so3.project(np.median(rotations, axis=0))
    for _ in range(MEDIAN_ITERATIONS):
        weights = 1 / np.maximum(np.linalg.norm(rotations - mean, axis=(1, 2)), NEAREST)
        previous, mean = mean, so3.project(np.average(rotations, axis=0, weights=weights))
        if so3.angle_between(mean, previous) < MEDIAN_TOLERANCE:
            break
    return mean
