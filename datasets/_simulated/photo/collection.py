"""A photo collection: its cameras, what they see, and the rotations measured between pairs of them."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from bench import Floats, InputError, Ints, Problem, so3, stream

from .cameras import Cameras, stand
from .layouts import Layout, arrange
from .matches import Matcher
from .points import Points, scatter
from .precision import precision
from .two_view import estimate
from .views import RESOLVED_PX, View, in_view, photograph

_PILOT = 20_000  # points scattered to see how many a camera has in view
_MOST_POINTS = 500_000  # of a place that its cameras hardly see
_COMMON = 20  # features that two pictures must share to be tried, as a search by content would find them
_WRONG_AGREE = 0.25  # share of wrong matches that some geometry explains; fewer than needed are not tried
OUTLIER_DEG = 20.0


@dataclass(frozen=True)
class Physics:
    """What a collection is simulated from: the parameters of the dataset, which explains them."""

    layout: Layout
    n: int
    focal_error: float
    exif: float
    distortion: float
    noise_px: float
    features: int
    mismatches: float
    one_sided: float
    repeated: float
    inliers: int

    @classmethod
    def of(cls, dataset: object) -> "Physics":
        """Those of a dataset that has parameters of the same names."""
        return cls(**{field.name: getattr(dataset, field.name) for field in fields(cls)})


@dataclass(frozen=True, eq=False)
class Collection:
    """What was measured, and the truth.

    Parameters
    ----------
    edges, rotations, counts, precisions
        (m, 2), (m, 3, 3), (m,) inlier matches, (m, 3, 3).
    truth
        (n, 3, 3) of the cameras of the largest component.
    outliers
        (m,) True where the measured rotation is over 20 degrees off.
    coherent
        (m,) True on outliers most of whose inliers are repetitions: they are wrong in the same way.
    """

    edges: Ints
    rotations: Floats
    counts: Floats
    precisions: Floats
    truth: Floats
    outliers: NDArray[np.bool_]
    coherent: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Edge:
    rotation: Floats
    count: int
    precision: Floats
    copied: float


def collect(physics: Physics, seed: int, progress: Callable[[int, int], None]) -> Collection:
    """Simulate a collection, on all cores.

    Every picture and every pair draws from a stream of its own, so that the number of cores does not matter. Threads
    share them, for COLMAP lets go of the interpreter as it works. `progress` is told how many pairs are done, of all.

    Raises
    ------
    InputError
        Where no two pictures match.
    """
    shooting = _shoot(physics, seed)
    pairs = _overlapping(shooting.views)
    measured: dict[tuple[int, int], _Edge] = {}
    pool = ThreadPoolExecutor(os.cpu_count())
    try:
        for done, (pair, edge) in enumerate(zip(pairs, pool.map(shooting.measure, pairs), strict=True), 1):
            progress(done, len(pairs))
            if edge is not None:
                measured[pair] = edge
    finally:
        pool.shutdown(cancel_futures=True)  # who interrupts does not wait for the rest
    if not measured:
        raise InputError("no two of these pictures match; choose a larger n, or more features")
    return _largest(measured, shooting.cameras.rotations)


@dataclass(frozen=True, eq=False)
class _Shooting:
    """All that measuring a pair needs."""

    physics: Physics
    seed: int
    cameras: Cameras
    points: Points
    views: list[View]

    def measure(self, pair: tuple[int, int]) -> _Edge | None:
        """The edge of a pair of cameras, where its matches make one."""
        i, j = pair
        physics, cameras = self.physics, self.cameras
        rng = stream(self.seed, "data", "photo-collection", "pair", f"{i}-{j}")
        matcher = Matcher(physics.mismatches, physics.one_sided)
        conditions = cameras.conditions[i] - cameras.conditions[j]
        matches = matcher.match(self.views[i], self.views[j], conditions, self.points, rng)
        agreeing = matches.right | matches.copied
        if agreeing.sum() + _WRONG_AGREE * (~agreeing).sum() < physics.inliers:
            return None
        found = estimate(matches, cameras, i, j, physics.inliers, int(rng.integers(2**31)))
        if found is None:
            return None
        inner = found.inliers
        first, second = (
            (pixels[inner] - cameras.sizes[k] / 2) / cameras.guesses[k]
            for k, pixels in ((i, matches.first), (j, matches.second))
        )
        known = precision(first, second, found.rotation, found.direction)
        return _Edge(found.rotation, len(inner), known, float(matches.copied[inner].mean()))


def _shoot(physics: Physics, seed: int) -> _Shooting:
    def draw(*what: str) -> np.random.Generator:
        return stream(seed, "data", "photo-collection", physics.layout, *what)

    place = arrange(physics.layout, physics.n, draw("place"))
    cameras = stand(place, physics.focal_error, physics.exif, physics.distortion, draw("cameras"))
    resolved = RESOLVED_PX * place.distance / float(np.median(cameras.focals))
    pilot = scatter(place.surfaces, [], 0.0, _PILOT, resolved, draw("points"))
    seen = np.median([len(in_view(k, cameras, pilot, place.surfaces)[0]) for k in range(physics.n)])
    count = min(round(_PILOT * physics.features / max(seen, 1)), _MOST_POINTS)
    points = scatter(place.surfaces, place.repetitions, physics.repeated, count, resolved, draw("points"))
    views = [
        photograph(k, cameras, points, place.surfaces, physics.noise_px, draw("view", str(k))) for k in range(physics.n)
    ]
    return _Shooting(physics, seed, cameras, points, views)


def _overlapping(views: list[View]) -> list[tuple[int, int]]:
    """Pairs of pictures with enough features in common to be tried."""
    from scipy.sparse import csr_array

    columns = np.concatenate([view.looks for view in views])
    starts = np.cumsum([0, *(len(view.looks) for view in views)])
    seen = csr_array((np.ones(len(columns), dtype=np.int32), columns, starts))
    i, j = np.nonzero(np.triu((seen @ seen.T).toarray(), 1) >= _COMMON)
    return list(zip(i.tolist(), j.tolist(), strict=True))


def _largest(measured: dict[tuple[int, int], _Edge], truth: Floats) -> Collection:
    """The largest component of what was measured."""
    edges = np.array(list(measured), dtype=np.int32)
    rotations = np.array([edge.rotation for edge in measured.values()])
    component = Problem(len(truth), edges, rotations).components
    cameras = np.flatnonzero(component == 0)
    label = np.cumsum(component == 0, dtype=np.int32) - 1
    kept = component[edges[:, 0]] == 0
    edges, rotations, truth = label[edges[kept]].astype(np.int32), rotations[kept], truth[cameras]
    found = [edge for edge, is_kept in zip(measured.values(), kept, strict=True) if is_kept]
    i, j = edges.T
    outliers = so3.angle_between(rotations, truth[i] @ np.swapaxes(truth[j], -1, -2)) > np.radians(OUTLIER_DEG)
    return Collection(
        edges,
        rotations,
        np.array([float(edge.count) for edge in found]),
        np.array([edge.precision for edge in found]),
        truth,
        outliers,
        outliers & np.array([edge.copied > 0.5 for edge in found]),
    )
