"""Folds: cameras of an estimate that share one wrong rotation of the world.

A part of a scene that was turned as one piece has R_i^est = R_i^true F for all its cameras i, so that
R_i^true^T R_i^est is one and the same matrix there, however different the cameras are. Folds are therefore dense
places of these matrices on SO(3) other than the largest one, which is the gauge. Neither an alignment nor the graph
is needed to find them; the graph then tells whether the measurements or the method turned them.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.problem import Floats, Problem

Key = TypeVar("Key", bound=Hashable)
Ids = NDArray[np.intp]

MIN_SHARE = 0.02
MIN_SIZE = 8
SMALL, SMALLEST = 4 * MIN_SIZE, 16  # scored cameras: below the one, other limits hold; below the other, none are sought
MIN_SIZE_SMALL = 6
MIN_ANGLE_DEG = 3.0
SAME = 0.5  # of the cameras of two folds together, from which on they are one and the same

SEEDS = 400  # cameras from which modes are sought
CORE = 0.25  # of the cameras; the smallest ball that holds them tells how precise the estimate is
RADII = (1.5, 3.0, 6.0)  # times that of the ball
NARROWEST_DEG, WIDEST_DEG = 0.3, 12.0
APART = 2.5  # radii
DIP = 0.5
CHANCE = 1e-6
REACH = 4.0  # median distances; of a Gaussian, all but one camera in 10^7
ITERATIONS = 30


@dataclass(frozen=True, eq=False)
class Fold:
    """Cameras that share one wrong rotation.

    Parameters
    ----------
    cameras
        (k,) ids, ascending.
    rotation
        (3, 3) F with R_i^est ~ R_i^true F, where the estimate is in the gauge of its largest consistent part.
    share
        Of the scored cameras.
    spread_deg
        Median distance of the cameras from `rotation`, degrees.
    main_spread_deg
        The same of the largest consistent part, from the gauge.
    """

    cameras: Ids
    rotation: Floats
    share: float
    spread_deg: float
    main_spread_deg: float

    @property
    def angle_deg(self) -> float:
        """Angle of the wrong rotation, degrees."""
        return float(np.degrees(so3.angle(self.rotation)))

    @property
    def axis(self) -> Floats:
        """Unit axis (3,) of the wrong rotation in the world of the truth."""
        vector = so3.log(self.rotation)
        return np.asarray(vector / np.linalg.norm(vector))


@dataclass(frozen=True, eq=False)
class SharedFold(Generic[Key]):
    """A fold that one or several methods have.

    Parameters
    ----------
    cameras
        (k,) ids, ascending: those that are in at least half of the folds.
    folds
        For each method that has it, its fold.
    """

    cameras: Ids
    folds: Mapping[Key, Fold]


@dataclass(frozen=True, eq=False)
class _Mode:
    """A dense place: its centre (3, 3), the radius at which it was found and the cameras (k,) within two radii."""

    centre: Floats
    radius: float
    cameras: Ids


def find_folds(rotations: Floats, truth: Floats) -> tuple[Fold, ...]:
    """Folds of an estimate, the largest first.

    The radius r of the smallest ball with a quarter of the cameras tells how precise the estimate is. At 1.5 r,
    3 r and 6 r, modes are sought by mean shift with a flat kernel. A mode is a fold where

    - it is at least 2.5 radii and `MIN_ANGLE_DEG` away from the largest mode and from other folds,
    - half-way to the largest mode there are at most `DIP` times as many cameras as at the mode itself,
    - a locally even density would put as many of the cameras around it within two radii with a probability below
      `CHANCE` (binomial; small, because a mode is the best of many places), and
    - it has at least `MIN_SIZE` cameras and `MIN_SHARE` of all, or `MIN_SIZE_SMALL` of fewer than `SMALL`; there the
      probability may be larger by as much as fewer cameras are fewer places.

    Every camera then goes to the nearest of the modes found, unless it is far from all of them.

    Parameters
    ----------
    rotations
        (n, 3, 3), NaN where a camera was not solved.
    truth
        (n, 3, 3), NaN where unknown.

    Returns
    -------
    tuple
        Empty where fewer than `SMALLEST` cameras are scored.
    """
    scored = np.flatnonzero(np.isfinite(rotations).all(axis=(1, 2)) & np.isfinite(truth).all(axis=(1, 2)))
    if len(scored) < SMALLEST:
        return ()
    turned = np.swapaxes(truth[scored], -1, -2) @ rotations[scored]
    modes = _main_and_folds(turned, smallest_fold(len(scored)))
    if len(modes) < 2:
        return ()
    members = _members(turned, modes)
    centres = [so3.geodesic_median(turned[own]) for own in members]
    spreads = [_spread_deg(turned[own], centre) for own, centre in zip(members, centres, strict=True)]
    folds = [
        Fold(scored[own], centre @ centres[0].T, len(own) / len(scored), spread, spreads[0])
        for own, centre, spread in zip(members[1:], centres[1:], spreads[1:], strict=True)
    ]
    if len(scored) < SMALL:  # so few may gather anywhere along errors about one axis
        folds = [fold for fold in folds if fold.angle_deg >= REACH * max(fold.main_spread_deg, fold.spread_deg)]
    return tuple(sorted(folds, key=lambda fold: -len(fold.cameras)))


def smallest_fold(scored: int) -> int:
    """Of how many cameras a fold must be, where so many are scored."""
    return MIN_SIZE_SMALL if scored < SMALL else max(MIN_SIZE, int(np.ceil(MIN_SHARE * scored)))


def shared_folds(folds: Mapping[Key, Sequence[Fold]]) -> list[SharedFold[Key]]:
    """Folds of several methods, put together where they turn the same cameras; those of most methods first.

    The angles may differ: where right and wrong measurements compete, every loss settles elsewhere.
    """
    groups: list[dict[Key, Fold]] = []
    for method, found in folds.items():
        for fold in found:
            fits = [g for g in groups if method not in g and _overlap(fold, next(iter(g.values()))) >= SAME]
            if fits:
                fits[0][method] = fold
            else:
                groups.append({method: fold})
    groups.sort(key=lambda group: (-len(group), -max(len(fold.cameras) for fold in group.values())))
    return [SharedFold(_in_half(list(group.values())), group) for group in groups]


def border(problem: Problem, at_estimate: Floats, at_truth: Floats, cameras: Ids) -> tuple[int, int]:
    """Whether the measurements are turned as well: how many edges into the fold fit the estimate better than the truth.

    Parameters
    ----------
    problem
        The graph.
    at_estimate, at_truth
        (m,) residuals; NaN where a camera is not solved or not known. They do not depend on the gauge.
    cameras
        (k,) ids of the fold.

    Returns
    -------
    tuple
        The number of those edges, and of all edges between the fold and other cameras that are solved and known.
    """
    inside = np.isin(problem.edges, cameras)
    across = (inside[:, 0] != inside[:, 1]) & np.isfinite(at_estimate) & np.isfinite(at_truth)
    return int((at_estimate < at_truth)[across].sum()), int(across.sum())


def _overlap(one: Fold, other: Fold) -> float:
    return len(np.intersect1d(one.cameras, other.cameras)) / len(np.union1d(one.cameras, other.cameras))


def _in_half(folds: Sequence[Fold]) -> Ids:
    ids, counts = np.unique(np.concatenate([fold.cameras for fold in folds]), return_counts=True)
    return np.asarray(ids[2 * counts >= len(folds)])


def _main_and_folds(turned: Floats, least: int) -> list[_Mode]:
    """The largest mode of rotations (k, 3, 3), then the folds, each at the finest radius at which it passes."""
    seeds = np.unique(np.linspace(0, len(turned) - 1, SEEDS).astype(int))
    distances = _distances(turned[seeds], turned)
    ball = np.sort(distances, axis=1)[:, int(CORE * len(turned))].min()
    kept: list[_Mode] = []
    for radius in np.maximum(ball * np.array(RADII), np.radians(NARROWEST_DEG)):
        if radius > np.radians(WIDEST_DEG):
            break
        modes = _modes(turned, seeds, (distances < radius).sum(axis=1), radius, least)
        kept = kept or modes[:1]
        for mode in modes:
            if all(_separate(mode, other) for other in kept) and _genuine(mode, kept[0], turned, least):
                kept.append(mode)
    return kept


def _modes(turned: Floats, seeds: Ids, counts: NDArray[np.intp], radius: float, least: int) -> list[_Mode]:
    """Places with more than half of `least` cameras within a radius, the densest first."""
    centres: list[Floats] = []
    for k in np.argsort(-counts, kind="stable"):
        if counts[k] <= least / 2:
            break
        if _near(turned[seeds[k]], centres, radius):
            continue
        centre = _shifted(turned, turned[seeds[k]], radius)
        if not _near(centre, centres, radius):
            centres.append(centre)
    if not centres:
        return []
    distances = _distances(np.array(centres), turned)
    nearest = np.where(distances.min(axis=0) < 2 * radius, distances.argmin(axis=0), -1)
    return [_Mode(centre, radius, np.flatnonzero(nearest == k)) for k, centre in enumerate(centres)]


def _near(rotation: Floats, centres: list[Floats], radius: float) -> bool:
    return bool(centres) and float(so3.angle_between(np.array(centres), rotation).min()) < APART * radius


def _shifted(turned: Floats, centre: Floats, radius: float) -> Floats:
    """Mean shift: the mean of the cameras within a radius, again and again."""
    for _ in range(ITERATIONS):
        near = so3.angle_between(turned, centre) < radius
        previous, centre = centre, so3.chordal_mean(turned[near])
        if float(so3.angle_between(previous, centre)) < 1e-3 * radius:
            break
    return centre


def _separate(mode: _Mode, other: _Mode) -> bool:
    gap = float(so3.angle_between(mode.centre, other.centre))
    return gap >= max(APART * max(mode.radius, other.radius), np.radians(MIN_ANGLE_DEG))


def _genuine(mode: _Mode, main: _Mode, turned: Floats, least: int) -> bool:
    """Whether a mode is large enough, parted from the main one, and no accident of a smooth tail."""
    from scipy.special import bdtrc

    if len(mode.cameras) < least:
        return False
    halfway = so3.exp(so3.log(mode.centre @ main.centre.T) / 2) @ main.centre
    from_mode, from_main, from_halfway = _distances(np.array([mode.centre, main.centre, halfway]), turned)
    if (from_halfway < mode.radius).sum() > DIP * (from_mode < mode.radius).sum():
        return False
    around = int(((from_mode < 4 * mode.radius) & (from_mode < from_main)).sum())
    within = int(((from_mode < 2 * mode.radius) & (from_mode < from_main)).sum())
    volume = 1 / 8  # of the ball of two radii in that of four
    chance = CHANCE * (SEEDS / len(turned) if len(turned) < SMALL else 1)  # there are fewer places to be the best of
    return (float(bdtrc(within - 1, around, volume)) if within < around else volume**within) < chance


def _members(turned: Floats, modes: list[_Mode]) -> list[Ids]:
    """Cameras of each mode: those nearest to it, and within `REACH` times their own median distance."""
    distances = _distances(np.array([mode.centre for mode in modes]), turned)
    nearest = distances.argmin(axis=0)
    own = [mode.cameras for mode in modes]
    for _ in range(ITERATIONS):
        reach = [REACH * np.median(distances[k, cameras]) for k, cameras in enumerate(own)]
        previous, own = own, [np.flatnonzero((nearest == k) & (distances[k] <= r)) for k, r in enumerate(reach)]
        if all(np.array_equal(a, b) for a, b in zip(previous, own, strict=True)):
            break
    return own


def _spread_deg(turned: Floats, centre: Floats) -> float:
    return float(np.degrees(np.median(so3.angle_between(turned, centre))))


def _distances(left: Floats, right: Floats) -> Floats:
    """(k, l) angles between rotations (k, 3, 3) and (l, 3, 3), from quaternions: good to 1e-7 radians only."""
    cosine = np.abs(so3.to_quaternion(left) @ so3.to_quaternion(right).T)
    angles: Floats = 2 * np.arccos(np.minimum(cosine, 1))
    return angles
