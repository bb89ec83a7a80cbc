"""Every choice between an estimate and the number that a paper prints of it, each as a switch."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.core import so3
from bench.core.problem import Estimate, Floats, Instance, Ints
from bench.scoring.metrics.alignment import RULES, align
from bench.scoring.metrics.oracle import curve

WORST_DEG = 180.0
Centre = Callable[[Floats], np.floating]
CENTRES: Mapping[str, Centre] = {"median": np.median, "mean": np.mean, "rms": lambda v: np.sqrt(np.mean(v**2))}
OVER_SEEDS: Mapping[str, Centre] = {"mean": np.mean, "median": np.median, "best": np.min}
CHOICES: dict[str, tuple[str, ...]] = {
    "alignment": RULES,
    "statistic": tuple(CENTRES),
    "over": ("cameras", "edges", "pairs"),
    "unsolved": ("left out", "as 180°"),
    "angle": ("atan2", "arccos"),
    "checkpoint": ("last", "oracle"),
    "seeds": tuple(OVER_SEEDS),
}

Answer = tuple[Estimate, Instance]


@dataclass(frozen=True)
class Measure:
    """How a number is made of the estimates of one method on one scene.

    Parameters
    ----------
    alignment
        Rule that removes the gauge; nothing to edges and pairs, whose angles have none.
    statistic
        ``median``, ``mean`` or ``rms`` (root mean square).
    over
        ``cameras``: angles to the truth after alignment. ``edges`` and ``pairs``: angles between R_i R_j^T and the
        truth's, over the measured edges or over all pairs of cameras.
    unsolved
        Cameras with a truth that the method did not solve: ``left out``, or ``as 180°``, and so every edge and pair.
    angle
        ``atan2``, or ``arccos`` of the trace, clamped to [-1, 1], as most code does: nothing below 1e-6 degrees.
    checkpoint
        ``last``: what the method returned. ``oracle``: the checkpoint with the smallest mean error against the
        truth, which no method can know.
    seeds
        ``mean``, ``median`` or ``best`` over seeds.
    """

    alignment: str = "l1"
    statistic: str = "median"
    over: str = "cameras"
    unsolved: str = "left out"
    angle: str = "atan2"
    checkpoint: str = "last"
    seeds: str = "mean"

    def of(self, answers: Sequence[Answer]) -> float:
        """The number, in degrees, of the answers under each seed; NaN where there is nothing to score."""
        numbers = np.array([self._of_one(*answer) for answer in answers])
        numbers = numbers[np.isfinite(numbers)]
        if not len(numbers):
            return float("nan")
        return float(OVER_SEEDS[self.seeds](numbers))

    def _of_one(self, estimate: Estimate, instance: Instance) -> float:
        if instance.truth is None:
            return float("nan")
        rotations = self._rotations(estimate, instance.truth)
        errors = self._errors(rotations, instance.truth, instance.problem.edges)
        errors = errors[np.isfinite(errors)] if self.unsolved == "left out" else np.nan_to_num(errors, nan=WORST_DEG)
        return float(CENTRES[self.statistic](errors)) if len(errors) else float("nan")

    def _rotations(self, estimate: Estimate, truth: Floats) -> Floats:
        along = curve(estimate, truth, self.alignment) if self.checkpoint == "oracle" else None
        return estimate.rotations if along is None else estimate.checkpoints[along.oracle].rotations

    def _errors(self, rotations: Floats, truth: Floats, edges: Ints) -> Floats:
        """Degrees, one for each camera, edge or pair whose truth is known; NaN where not solved."""
        known = np.asarray(np.isfinite(truth).all(axis=(1, 2)))
        gauges = np.swapaxes(rotations, -1, -2) @ truth  # all the same, and the gauge, where there is no error
        if self.over == "cameras":
            solved = np.isfinite(gauges[known]).all(axis=(1, 2))
            if not solved.any():
                return np.full(int(known.sum()), np.nan)
            common = np.flatnonzero(known)[solved]
            gauge = align(rotations[common], truth[common], self.alignment)
            return self._angles(gauges[known], gauge)
        if self.over == "edges":
            i, j = edges[known[edges[:, 0]] & known[edges[:, 1]]].T
            return self._angles(gauges[i], gauges[j])
        inside = gauges[known]
        rows = (self._angles(inside[k + 1 :], inside[k]) for k in range(len(inside) - 1))
        return np.concatenate([*rows, np.empty(0)])

    def _angles(self, a: Floats, b: Floats) -> Floats:
        if self.angle == "atan2":
            angles = np.full(len(a), np.nan)
            finite = np.isfinite(a).all(axis=(1, 2)) & np.isfinite(np.broadcast_to(b, a.shape)).all(axis=(1, 2))
            angles[finite] = so3.angle_between(a[finite], np.broadcast_to(b, a.shape)[finite])
            return np.degrees(angles)
        trace = (a * b).sum(axis=(-1, -2))
        return np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1)))
