"""Where each method stands over several scenes. A pure function of what the tables say of each scene."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from bench.reporting.tables.rows import Entry, Scene, Ties
from bench.reporting.tables.rows import scenes as scenes_of
from bench.scoring.inference.blocks import Blocks, blocks, headline
from bench.scoring.inference.ranking import mean_ranks
from bench.scoring.inference.resampling import FLOOR_DEG
from bench.scoring.results import Configured


@dataclass(frozen=True)
class Standing:
    """One configured method over the scenes with ground truth.

    Parameters
    ----------
    key, label
        The configured method, and the selection that runs it.
    scenes, ended
        How many scenes it was planned on, and on how many every seed of it ended well.
    outcomes
        Those other than ok, each once.
    best_on
        Names of the scenes on which it cannot be told apart from the best.
    rank
        Mean rank of its median error, failures last, see `bench.scoring.inference.ranking.mean_ranks`; NaN for a
        method that was not run on every scene.
    median_deg, mean_deg, seconds
        Geometric means over the scenes; NaN for a method that did not end well on all of them, because a mean over
        easier scenes would flatter it.
    """

    key: Configured
    label: str
    scenes: int
    ended: int
    outcomes: tuple[str, ...]
    best_on: tuple[str, ...]
    rank: float
    median_deg: float
    mean_deg: float
    seconds: float

    @property
    def complete(self) -> bool:
        """Whether it ended well on every scene."""
        return self.ended == self.scenes


def ranks_of(table: Blocks) -> dict[Configured, float]:
    """Mean ranks by configured method."""
    return dict(zip(table.methods, mean_ranks(table).tolist(), strict=True))


def overall(frame: pd.DataFrame, ties: Ties) -> tuple[list[Scene], list[Standing]]:
    """The scenes that findings are about, see `bench.scoring.inference.blocks.headline`, and the standings on them."""
    scenes = scenes_of(headline(frame), ties)
    return scenes, standings(scenes, ranks_of(blocks(frame)))


def standings(scenes: Sequence[Scene], ranks: Mapping[Configured, float]) -> list[Standing]:
    """Standings on the scenes that have ground truth, the best mean rank first; empty where none has.

    Parameters
    ----------
    scenes
        Of one protocol, where any was run under several.
    ranks
        Over all of them, see `ranks_of`.
    """
    known = [scene for scene in scenes if any(entry.scored for entry in scene.entries)]
    entries: dict[Configured, list[tuple[Scene, Entry]]] = {}
    for scene in known:
        for entry in scene.entries:
            entries.setdefault(entry.key, []).append((scene, entry))
    found = [_standing(key, of_method, ranks.get(key, math.nan)) for key, of_method in entries.items()]
    return sorted(found, key=lambda s: (math.isnan(s.rank), s.rank, s.label))


def ended_well(entry: Entry) -> bool:
    """Whether every seed of it did, and was scored."""
    return entry.ok == entry.seeds and entry.values["median_deg"].known


def geometric_mean(values: Iterable[float]) -> float:
    """Mean that a factor of two up and one of two down leave alone; exact recoveries count as `FLOOR_DEG`."""
    logs = [math.log(max(value, FLOOR_DEG)) for value in values]
    return math.exp(float(np.mean(logs))) if logs else math.nan


def _standing(key: Configured, rows: Sequence[tuple[Scene, Entry]], rank: float) -> Standing:
    ended = [entry for _, entry in rows if ended_well(entry)]

    def mean(name: str) -> float:
        return geometric_mean(e.values[name].mean for e in ended) if len(ended) == len(rows) else math.nan

    return Standing(
        label=rows[0][1].label,
        key=key,
        scenes=len(rows),
        ended=len(ended),
        outcomes=tuple(dict.fromkeys(ended for _, entry in rows for ended in entry.outcomes)),
        best_on=tuple(scene.instance for scene, entry in rows if entry.best),
        rank=rank,
        median_deg=mean("median_deg"),
        mean_deg=mean("mean_deg"),
        seconds=mean("solve_s"),
    )
