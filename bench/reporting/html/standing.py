"""Where each method stands over several scenes. A pure function of what the tables say of each scene."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

from bench.reporting.tables.rows import Configured, Entry, Scene
from bench.scoring.inference.resampling import FLOOR_DEG
from bench.scoring.inference.statistics import MIN_COVERAGE


@dataclass(frozen=True)
class Standing:
    """One configured method over the scenes with ground truth.

    Parameters
    ----------
    label, method, params
        The selection that runs it, and its parts.
    scenes, ended
        How many scenes it was planned on, and on how many every seed of it ended well.
    best_on
        Names of the scenes on which it cannot be told apart from the best.
    rank
        Mean over the scenes of the rank of its median error, methods that failed last.
    median_deg, mean_deg, seconds
        Geometric means over the scenes; NaN for a method that did not end well on all of them, because a mean over
        easier scenes would flatter it.
    """

    label: str
    method: str
    params: str
    scenes: int
    ended: int
    best_on: tuple[str, ...]
    rank: float
    median_deg: float
    mean_deg: float
    seconds: float

    @property
    def complete(self) -> bool:
        """Whether it ended well on every scene."""
        return self.ended == self.scenes


def standings(scenes: Sequence[Scene]) -> list[Standing]:
    """Standings on the scenes that have ground truth, the best mean rank first; empty where none has."""
    known = [scene for scene in scenes if any(entry.scored for entry in scene.entries)]
    entries: dict[Configured, list[tuple[Scene, Entry, float]]] = {}
    for scene in known:
        for entry, rank in zip(scene.entries, ranks(scene), strict=True):
            entries.setdefault((entry.method, entry.params), []).append((scene, entry, rank))
    found = [_standing(key, of_method) for key, of_method in entries.items()]
    return sorted(found, key=lambda s: (s.rank, s.label))


def ranks(scene: Scene) -> list[float]:
    """Rank of each entry's median error, the mean rank where medians are equal.

    Entries that did not end well are last; those that scored fewer than 95 % of the cameras of the most complete one
    come just before them: leaving out the hard cameras must not win.
    """
    most = max((entry.scored for entry in scene.entries), default=0)

    def value(entry: Entry) -> float:
        median = entry.values["median_deg"].mean
        if not entry.ok or not math.isfinite(median):
            return math.inf
        return median if entry.scored >= MIN_COVERAGE * most else 1e6 + median

    return [float(rank) for rank in rankdata([value(entry) for entry in scene.entries])]


def ended_well(entry: Entry) -> bool:
    """Whether every seed of it did, and was scored."""
    return entry.ok == entry.seeds and entry.values["median_deg"].known


def geometric_mean(values: Iterable[float]) -> float:
    """Mean that a factor of two up and one of two down leave alone; exact recoveries count as `FLOOR_DEG`."""
    logs = [math.log(max(value, FLOOR_DEG)) for value in values]
    return math.exp(float(np.mean(logs))) if logs else math.nan


def _standing(key: Configured, rows: Sequence[tuple[Scene, Entry, float]]) -> Standing:
    ended = [entry for _, entry, _ in rows if ended_well(entry)]

    def mean(name: str) -> float:
        return geometric_mean(e.values[name].mean for e in ended) if len(ended) == len(rows) else math.nan

    return Standing(
        label=rows[0][1].label,
        method=key[0],
        params=key[1],
        scenes=len(rows),
        ended=len(ended),
        best_on=tuple(scene.instance for scene, entry, _ in rows if entry.best),
        rank=float(np.mean([rank for *_, rank in rows])),
        median_deg=mean("median_deg"),
        mean_deg=mean("mean_deg"),
        seconds=mean("solve_s"),
    )
