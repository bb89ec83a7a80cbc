"""Two sides of the same problems, paired job by job: the ratio of their errors and times on a scene and over scenes."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.core.outcome import OK
from bench.core.problem import Floats
from bench.scoring.inference.difference import holm
from bench.scoring.inference.ratio import Ratio, error_ratio, mean_ratio, time_ratio
from bench.scoring.inference.resampling import CENTRES, SMALLEST, Statistic, padded, seed_scores
from bench.scoring.results import CONFIGURED, PLACE, Configured, Place, Results

Cell = tuple[str, str, str, str, str, int]  # dataset, instance, protocol, method, params, seed
Row = dict[str, Any]

NOWHERE: Place = ("", "", "")
IDENTICAL = "identical"
NEITHER = (np.nan, np.nan)
STATISTICS: tuple[Statistic, ...] = ("median", "mean")
TIME = "time"
COLUMNS = (
    *("level", "dataset", "instance", "protocol", "method", "params", "quantity"),
    *("old", "new", "ratio", "low", "high", "p_value", "p_holm", "verdict"),
)


@dataclass(frozen=True)
class Job:
    """What a table knows of a job, and its camera errors (n,) in degrees, None without ground truth."""

    row: Mapping[str, Any]
    errors: Floats | None

    @property
    def ended(self) -> str:
        """Its outcome."""
        return str(self.row["outcome"])

    @property
    def rounds(self) -> Floats:
        """Seconds of each round of a timing run; empty otherwise."""
        return np.asarray(self.row.get("round_s", ()), dtype=float).ravel()


Pairs = Mapping[Cell, tuple[Job, Job]]
Key = tuple[Place, Configured, str]  # the last is a quantity


def jobs_of(results: Results) -> dict[Cell, Job]:
    """Every job of a run."""
    found = {}
    for row in results.frame.to_dict("records"):
        known = {str(name): value for name, value in row.items()}
        cell = (*(known[name] for name in (*PLACE, *CONFIGURED)), int(known["seed"]))
        found[cell] = Job(known, results.job_errors.get(known["job"]))
    return found


def of_scenes(pairs: Pairs, with_times: bool) -> dict[Key, "Compared"]:
    """Ratio, second to first, of every method on every scene, of each quantity.

    Parameters
    ----------
    pairs
        Only jobs of which both ended well are compared, on the cameras that both have scored.
    with_times
        Whether their rounds are compared too, as `TIME`.
    """
    groups: dict[tuple[Place, Configured], list[tuple[Job, Job]]] = {}
    instances: dict[Place, set[str]] = {}
    for (dataset, instance, protocol, method, params, _), pair in pairs.items():
        place: Place = (dataset, instance, protocol)
        instances.setdefault(place, set()).add(pair[0].row["instance_key"])
        groups.setdefault((place, (method, params)), []).append(pair)
    found: dict[Key, Compared] = {}
    for (place, configured), members in groups.items():
        well = [(a, b) for a, b in members if a.ended == b.ended == OK]
        scored = [(a.errors, b.errors) for a, b in well if a.errors is not None and b.errors is not None]
        if scored:
            for statistic in STATISTICS:
                one = _errors(scored, statistic, same_cameras=len(instances[place]) == 1)
                found[place, configured, statistic] = one
        timed = [(a.rounds, b.rounds) for a, b in well if len(a.rounds) and len(b.rounds)]
        if with_times and timed:
            found[place, configured, TIME] = _times(timed)
    return {key: one for key, one in found.items() if np.isfinite(one.ratio.value)}


@dataclass(frozen=True)
class Compared:
    """Two values and their ratio; `same` where nothing differs."""

    old: float
    new: float
    ratio: Ratio
    same: bool = False


def _errors(scored: Sequence[tuple[Floats, Floats]], statistic: Statistic, same_cameras: bool) -> Compared:
    """On the cameras that both have scored."""
    old, new = padded([a for a, _ in scored]), padded([b for _, b in scored])
    ratio = error_ratio(new, old, statistic, same_cameras=same_cameras)
    same = np.array_equal(old, new, equal_nan=True)
    table = np.stack([old, new])
    table = np.where(np.isfinite(table).all(axis=0), table, np.nan)
    before, after = np.nanmean(seed_scores(table, CENTRES[statistic]), axis=1) if np.isfinite(table).any() else NEITHER
    return Compared(float(before), float(after), ratio, same)


def _times(timed: Sequence[tuple[Floats, Floats]]) -> Compared:
    """Of one seed its rounds are compared, of several the seeds' ratios."""
    before, after = (float(np.mean([np.median(pair[k]) for pair in timed])) for k in (0, 1))
    same = all(np.array_equal(a, b) for a, b in timed)
    return Compared(before, after, mean_ratio([time_ratio(b, a) for a, b in timed]), same)


def of_methods(scenes: Mapping[Key, Compared]) -> dict[Key, Compared]:
    """Of every method over its scenes."""
    groups: dict[Key, list[Compared]] = {}
    for (_, method, quantity), one in scenes.items():
        groups.setdefault((NOWHERE, method, quantity), []).append(one)
    return {key: mean(members) for key, members in groups.items()}


def mean(members: Sequence[Compared]) -> Compared:
    """Geometric means over several scenes, see `bench.scoring.inference.ratio.mean_ratio`."""
    return Compared(
        geometric([one.old for one in members]),
        geometric([one.new for one in members]),
        mean_ratio([one.ratio for one in members]),
        all(one.same for one in members),
    )


def geometric(values: Sequence[float]) -> float:
    """Geometric mean; what is below rounding counts as that."""
    return float(np.exp(np.mean(np.log(np.maximum(values, SMALLEST)))))


def judged(level: str, found: Mapping[Key, Compared], threshold: float, levels: int) -> Iterator[Row]:
    """Rows of one level, as `COLUMNS` says.

    Parameters
    ----------
    level, found
        What the rows are about; their p values are corrected together (Holm), then for the number of `levels`.
    threshold
        A ratio between 1 / threshold and threshold is neither better nor worse.
    """
    p_values = holm([np.nan if one.same else one.ratio.p_value for one in found.values()])
    for ((place, (method, params), quantity), one), of_level in zip(found.items(), p_values, strict=True):
        ratio, p = one.ratio, float(np.minimum(levels * of_level, 1))
        verdict = IDENTICAL if one.same else ratio.verdict(p, threshold)
        head = (level, *place, method, params, quantity)
        values = (one.old, one.new, ratio.value, ratio.low, ratio.high, ratio.p_value, p, verdict)
        yield dict(zip(COLUMNS, (*head, *values), strict=True))
