"""Which reading of the truth and of the measurements makes them fit each other."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.core import so3
from bench.core.problem import Floats, Ints, Problem
from bench.scoring.conventions import readings
from bench.scoring.conventions.contrast import DEVIATIONS, Contrast, contrast, logs, mixture
from bench.scoring.conventions.readings import CAMERA_TO_WORLD, INVERSE, Change, Ids, Reading, Turn

SAMPLE = 2_000  # edges that readings are tried on
PAIRS = 20_000  # measurements that meet the truth of other cameras
ALIKE = 0.05  # of the mean log residual: readings no further apart cannot be told from each other
CONTENDERS = 50  # readings whose residuals are looked at one by one
LOOSE = 0.3  # of the same: what a turn that is fitted has to be better by than one that is not
GUESSES = 200  # turns of the axes, each from two edges

Pair = tuple[Reading, Reading]  # of the truth (n, 3, 3) and of the measurements (k, 3, 3)


@dataclass(frozen=True, eq=False)
class Fit:
    """A reading of the truth, of the measurements and of the axes, with the residuals (k,) it leaves, degrees."""

    truth: Reading
    measured: Reading
    turn: Turn
    residuals: Floats

    @property
    def changes(self) -> tuple[Change, ...]:
        """What differs from the data as given."""
        return (*self.truth.changes, *self.turn.changes, *self.measured.changes)


@dataclass(frozen=True, eq=False)
class Explained:
    """The simplest of the readings that fit best: none, where the data fit as given or no other clearly does.

    Parameters
    ----------
    changes
        What differs from the data as given.
    given, residuals
        Residuals of the edges as given, and as explained; degrees, where known.
    alike
        Other readings with as few changes that fit as well.
    contrast
        To the data as given; None where nothing differs.
    reversed
        Share of the edges that fit only when they are transposed, of all that fit; 0 where that may be chance.
    """

    changes: tuple[Change, ...]
    given: Floats
    residuals: Floats
    alike: tuple[Fit, ...] = ()
    contrast: Contrast | None = None
    reversed: float = 0.0


def explain(problem: Problem, truth: Floats, ids: Ids, names: Sequence[str] | None, table: Floats | None) -> Explained:
    """The reading under which the truth clearly fits; the data as given where it does, or where none is clear."""
    known = np.asarray(np.isfinite(truth).all(axis=(1, 2)))
    chosen = np.flatnonzero(known[problem.edges].all(axis=1))
    if len(chosen) > SAMPLE:
        chosen = np.sort(np.random.default_rng(0).choice(chosen, SAMPLE, replace=False))
    edges, rotations = problem.edges[chosen], problem.rotations[chosen]
    as_given = _fit(edges, Reading(truth), Reading(rotations), Turn(np.eye(3)))
    if len(edges) < 2:
        return Explained((), as_given.residuals, as_given.residuals)
    listed, tried = _listed(edges, truth, rotations, ids, names, table)
    guessed = _guessed(edges, truth, rotations)
    free = 3 if _better(guessed, listed[0]) else 0
    fits = [guessed] if free else listed
    best = fits[0]
    own = np.isfinite(best.residuals)
    independent = min(int(own.sum()), len(np.unique(edges[own])) - 1) - free
    if independent > 0 and best.changes:
        null = _null(edges[own], replace(best, measured=Reading(best.measured.rotations[own])))
        found = contrast(as_given.residuals[own], best.residuals[own], null, independent, tried)
        if found:
            return _explained(edges, as_given.residuals, best, tuple(fits[1:]), found)
    return _explained(edges, as_given.residuals, as_given, (), None)


def null_residuals(problem: Problem, truth: Floats) -> Floats:
    """Residuals, in degrees, of measurements at the truth of other cameras: those of a truth that tells nothing."""
    as_given = Fit(Reading(truth), Reading(problem.rotations), Turn(np.eye(3)), np.empty(0))
    return _null(problem.edges, as_given)


def _listed(
    edges: Ints, truth: Floats, rotations: Floats, ids: Ids, names: Sequence[str] | None, table: Floats | None
) -> tuple[list[Fit], int]:
    """The best of the known mistakes, alone and together, and how many there are."""
    of_truth, reordered = readings.of_truth(truth), readings.reordered(truth, ids, names, table)
    measured = readings.of_measurements(rotations)
    pairs = [(reading, measured[0]) for reading in (*of_truth, *reordered)]
    pairs += [(of_truth[0], reading) for reading in measured[1:]]
    every, listed = list(_every_way(pairs)), readings.turns()
    matrices = np.array([turn.matrix for turn in listed])
    scores = np.array([_scores(edges, pair, matrices) for pair in every])
    # the quaternions of a truth in another order, and turned, are its transpose in other axes and another gauge
    scores[4 : 4 * len(of_truth), 1:] = np.nan
    ranked = np.argsort(np.where(np.isnan(scores), np.inf, scores), axis=None, kind="stable")[:CONTENDERS]
    places = np.sort(ranked[np.isfinite(scores.ravel()[ranked])])
    contenders = [(every[k // len(listed)], listed[k % len(listed)]) for k in places.tolist()]
    fits = [_fit(edges, one, other, turn) for (one, other), turn in contenders]
    return _simplest_first(fits), scores.size + 4 * GUESSES


def _guessed(edges: Ints, truth: Floats, rotations: Floats) -> Fit:
    """The best turn of the axes by any angle: guessed from two edges that turn by the same angles in both, refined."""
    fits = []
    for pair in _every_way([(Reading(truth), Reading(rotations))]):
        guesses = _guesses(_relative(edges, pair[0].rotations), pair[1].rotations)
        turn = guesses[int(np.argmin(_scores(edges, pair, guesses)))]
        fits.append(_fit(edges, *pair, readings.fitted_turn(_refined(edges, pair, turn))))
    return _simplest_first(fits)[0]


def _better(one: Fit, other: Fit) -> bool:
    """Whether a fit is better than another by more than its freedom can do."""
    by = logs(other.residuals) - logs(one.residuals)
    by = by[np.isfinite(by)]
    return bool(len(by) and by.mean() > LOOSE + DEVIATIONS * by.std() / np.sqrt(len(by)))


def _every_way(pairs: Sequence[Pair]) -> Iterator[Pair]:
    for truth, measured in pairs:
        for other in readings.both_ways(measured, INVERSE):
            for one in readings.both_ways(truth, CAMERA_TO_WORLD):
                yield one, other


def _relative(edges: Ints, absolute: Floats) -> Floats:
    i, j = edges.T
    return np.asarray(absolute[i] @ np.swapaxes(absolute[j], -1, -2))


def _fit(edges: Ints, truth: Reading, measured: Reading, turn: Turn) -> Fit:
    predicted = turn.matrix @ _relative(edges, truth.rotations) @ turn.matrix.T
    return Fit(truth, measured, turn, np.degrees(so3.angle_between(measured.rotations, predicted)))


def _scores(edges: Ints, pair: Pair, matrices: Floats) -> Floats:
    """Mean log residuals (t,) under turns (t, 3, 3); NaN where too few cameras are known.

    Of quaternions (w, v) and (w', v'), the latter turned, the product has the real part w w' + v . F v'.
    """
    relative = _relative(edges, pair[0].rotations)
    known = np.isfinite(relative).all(axis=(1, 2))
    if 2 * known.sum() < len(edges):
        return np.full(len(matrices), np.nan)
    one, other = so3.to_quaternion(pair[1].rotations[known]), so3.to_quaternion(relative[known])
    outer = one[:, 1:, None] * other[:, None, 1:]
    cosine = one[:, :1] * other[:, :1] + outer.reshape(-1, 9) @ matrices.reshape(-1, 9).T
    return np.asarray(logs(np.degrees(2 * np.arccos(np.minimum(abs(cosine), 1)))).mean(axis=0))


def _simplest_first(fits: list[Fit]) -> list[Fit]:
    """Those that cannot be told from the best of them, the one with the fewest changes first."""
    values = [logs(fit.residuals) for fit in fits]
    best = values[int(np.argmin([np.nanmean(value) for value in values]))]
    alike = []
    for fit, value in zip(fits, values, strict=True):
        further = (value - best)[np.isfinite(value - best)]
        if len(further) and further.mean() <= ALIKE + further.std() / np.sqrt(len(further)):
            alike.append(fit)
    fewest = min(len(fit.changes) for fit in alike)
    return [fit for fit in alike if len(fit.changes) == fewest]


def _null(edges: Ints, fit: Fit) -> Floats:
    """Residuals where every measurement meets the truth of two cameras drawn at random, other than its own."""
    rng = np.random.default_rng(0)
    known = np.flatnonzero(np.isfinite(fit.truth.rotations).all(axis=(1, 2)))
    drawn = rng.choice(known, (PAIRS, 2))
    row = rng.integers(0, len(edges), PAIRS)
    other = (drawn[:, 0] != drawn[:, 1]) & (np.sort(drawn, axis=1) != np.sort(edges[row], axis=1)).any(axis=1)
    measured = Reading(fit.measured.rotations[row[other]])
    return _fit(drawn[other], fit.truth, measured, fit.turn).residuals


def _explained(edges: Ints, given: Floats, fit: Fit, alike: tuple[Fit, ...], found: Contrast | None) -> Explained:
    inverse = Reading(np.swapaxes(fit.measured.rotations, -1, -2))
    turned = _fit(edges, fit.truth, inverse, fit.turn).residuals
    share = mixture(fit.residuals, turned, _null(edges, replace(fit, measured=inverse)))
    residuals = np.minimum(fit.residuals, turned) if share else fit.residuals
    return Explained(fit.changes, given, residuals[np.isfinite(residuals)], alike, found, share)


def _guesses(relative: Floats, measured: Floats) -> Floats:
    """Turns (g, 3, 3), each by which the axes of two edges' rotations go over into those measured."""
    rng = np.random.default_rng(0)
    u, v = so3.log(measured), so3.log(relative)
    off = abs(np.linalg.norm(u, axis=1) - np.linalg.norm(v, axis=1))
    likely = np.argsort(off, kind="stable")[: max(2, len(off) // 2)]
    rows = rng.choice(likely, (GUESSES, 2))
    return so3.project(np.einsum("gki,gkj->gij", u[rows], v[rows]))


def _refined(edges: Ints, pair: Pair, turn: Floats) -> Floats:
    """The turn that the better half of the edges agrees on: fitted to them, again and again (Kabsch 1976)."""
    u, v = so3.log(pair[1].rotations), so3.log(_relative(edges, pair[0].rotations))
    for _ in range(10):
        away = np.linalg.norm(u - v @ turn.T, axis=1)
        weight = 1 / (away + np.median(away) / 10 + 1e-9)
        turn = so3.project(np.einsum("k,ki,kj->ij", weight, u, v))
    return turn
