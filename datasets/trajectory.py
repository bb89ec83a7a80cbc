"""Simulated trajectories: measurements from pose to pose, and loop closures of which some are wrong."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Instance, Ints, Problem, Source, dataset, parameter, so3, stream

from ._files.folders import revision
from ._simulated.measurements import CODE, Measurements
from ._simulated.statistics import statistics

Layout = Literal["spiral", "torus", "walk", "survey"]
_TURN_DEG = 10.0  # standard deviation about each axis, from a pose to the next
_CLOSURES = 0.2  # of a walk, for each pose


@dataset("trajectory", title="Trajectories, simulated", cite="carlone2015")
@dataclass(frozen=True)
class Trajectory:
    """Poses in a sequence: each is measured against the next one, which is never wrong, and against earlier ones.

    The graphs of SLAM, in the manner of the simulated ones of Carlone, Tron, Daniilidis and Dellaert (2015): few edges
    at a pose, hardly any triangles but in a survey, and errors that are normal, but for loop closures between places
    that only look alike. From a pose to the next the rotation changes by a random one of some 17 degrees.

    Parameters
    ----------
    n
        Poses.
    layout
        ``spiral``: laps of sqrt(n) poses, rounded; a pose also sees the one that is a lap ahead, as in sphere2500.
        ``torus``: the same, and the last lap meets the first. ``walk``: loop closures between random poses, one for
        every five. ``survey``: rows of sqrt(n) poses to and fro; a pose sees the eight around it.
    noise_deg
        Standard deviation of the error about each axis, degrees.
    wrong
        Fraction of the loop closures that are uniform rotations instead, rounded.
    """

    n: int = parameter(400, at_least=9)
    layout: Layout = "spiral"
    noise_deg: float = parameter(2.0, at_least=0, at_most=180)
    wrong: float = parameter(0.1, at_least=0, at_most=1)

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source]:
        """One instance for each seed."""
        identity = revision([Path(__file__), *CODE], repr(self), str(seed))
        yield Source(self._name(), identity, lambda: self._generate(seed, identity), seeded=True)

    def _generate(self, seed: int, identity: str) -> Instance:
        rng = stream(seed, "data", "trajectory")
        truth = _turning(self.n, rng)
        steps = np.stack([np.arange(self.n - 1), np.arange(1, self.n)], axis=1)
        closures = self._closures(rng)
        edges = np.concatenate([steps, closures]).astype(np.int32)
        rotations, _ = Measurements(self.noise_deg, outliers=0.0, noise="tangent").simulate(truth, edges, rng)
        outliers = np.zeros(len(edges), dtype=bool)
        outliers[len(steps) + rng.permutation(len(closures))[: round(self.wrong * len(closures))]] = True
        rotations[outliers] = so3.random(rng, int(outliers.sum()))
        problem = Problem(self.n, edges, rotations)
        return Instance(
            problem,
            truth,
            name=self._name(),
            outliers=outliers,
            source=f"simulated: a {self.layout} of poses, normal errors, {100 * self.wrong:g} % of the closures wrong",
            revision=identity,
            statistics=statistics(problem),
        )

    def _closures(self, rng: np.random.Generator) -> Ints:
        """Pairs (k, 2) of poses that are not neighbours in the sequence."""
        poses, lap = np.arange(self.n), round(np.sqrt(self.n))
        if self.layout == "walk":
            pairs = np.sort(rng.integers(self.n, size=(round(_CLOSURES * self.n), 2)), axis=1)
        elif self.layout == "torus":
            pairs = np.sort(np.stack([poses, (poses + lap) % self.n], axis=1), axis=1)
            pairs = np.concatenate([pairs, [[0, self.n - 1]]])
        elif self.layout == "survey":
            pairs = _around(poses // lap, np.where(poses // lap % 2, lap - 1 - poses % lap, poses % lap))
        else:
            pairs = np.stack([poses[:-lap], poses[lap:]], axis=1)
        return np.unique(pairs[np.diff(pairs)[:, 0] > 1], axis=0).astype(np.int32)

    def _name(self) -> str:
        """``spiral-n400-noise2-wrong0.1``."""
        return f"{self.layout}-n{self.n}-noise{self.noise_deg:g}-wrong{self.wrong:g}"


def _around(rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs (k, 2) of points of a grid that touch, also at a corner."""
    from scipy.spatial import KDTree

    touching = KDTree(np.stack([rows, columns], axis=1)).query_pairs(1.5, output_type="ndarray")
    return np.asarray(touching, dtype=np.int64)


def _turning(n: int, rng: np.random.Generator) -> Floats:
    """Rotations (n, 3, 3), each a little turned from the one before."""
    turns = so3.exp(np.radians(_TURN_DEG) * rng.standard_normal((n, 3)))
    for before, turn in itertools.pairwise(turns):
        turn[:] = turn @ before
    return turns
