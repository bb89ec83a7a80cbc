"""Two runs of the same problems, one against the other: what became better, worse, or cannot be told."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.core.errors import InputError
from bench.core.outcome import OK
from bench.core.problem import Floats
from bench.plugins.selection import label
from bench.scoring.inference.difference import holm
from bench.scoring.inference.ratio import Ratio, error_ratio, mean_ratio, time_ratio
from bench.scoring.inference.resampling import CENTRES, SMALLEST, Statistic, padded, seed_scores
from bench.scoring.results import CONFIGURED, PLACE, Configured, Place, Results

if TYPE_CHECKING:
    import pandas as pd

Cell = tuple[str, str, str, str, str, int]  # dataset, instance, protocol, method, params, seed
Row = dict[str, Any]

ALL = "all"
NOWHERE: Place = ("", "", "")
IDENTICAL = "identical"
NEITHER = (np.nan, np.nan)
LEVELS = 3  # that a verdict is given at: all, method and scene
STATISTICS: tuple[Statistic, ...] = ("median", "mean")
TIME = "time"
COLUMNS = (
    *("level", "dataset", "instance", "protocol", "method", "params", "quantity"),
    *("old", "new", "ratio", "low", "high", "p_value", "p_holm", "verdict"),
)


@dataclass(frozen=True)
class Change:
    """A job that ended otherwise than before, or solved other cameras."""

    cell: Cell
    old: str
    new: str
    worse: bool

    def __str__(self) -> str:
        """A sentence."""
        dataset, instance, _, method, params, seed = self.cell
        return f"{label(method, params)} on {dataset}/{instance}, seed {seed}: {self.old} -> {self.new}"


@dataclass(frozen=True, eq=False)
class Comparison:
    """What two runs have in common, and how they differ there.

    Parameters
    ----------
    rows
        `COLUMNS`; level "all" is everything together, "method" a method over its scenes, "scene" a method on a scene. A
        quantity is "median", "mean" or "time"; `ratio` is new to old, with its 95 % interval; `p_holm` is corrected
        for all rows.
    outcomes
        Jobs that ended otherwise, or with other cameras solved.
    cells
        How many jobs were compared.
    identical
        Whether every one of them ended the same, with the same errors to the last bit.
    notes
        What is not compared, and why.
    """

    rows: "pd.DataFrame"
    outcomes: tuple[Change, ...]
    cells: int
    identical: bool
    notes: tuple[str, ...]

    @property
    def regressed(self) -> bool:
        """Whether anything is worse."""
        return bool((self.rows["verdict"] == "worse").any()) or any(change.worse for change in self.outcomes)


@dataclass(frozen=True)
class _Job:
    row: Mapping[str, Any]
    errors: Floats | None

    @property
    def ended(self) -> str:
        return str(self.row["outcome"])

    @property
    def rounds(self) -> Floats:
        return np.asarray(self.row.get("round_s", ()), dtype=float).ravel()


_Pairs = Mapping[Cell, tuple[_Job, _Job]]
_Key = tuple[Place, Configured, str]  # the last is a quantity


def compare(old: Results, new: Results, threshold: float = 1.05, *, no_times: str = "") -> Comparison:
    """Compare what two runs have in common: the same problem to the byte, method, parameters and seed.

    Errors are compared where both ended well: on a scene by a paired bootstrap over cameras and Student's t over
    seeds, over scenes by Student's t on the logarithms of the scenes' ratios. The p values of a level are corrected
    together (Holm), then for the number of levels. A method can be worse on one scene and not over all.

    Parameters
    ----------
    old, new
        Scored with the same alignment.
    threshold
        A ratio between 1 / threshold and threshold is neither better nor worse.
    no_times
        Why times are not compared; "" compares those of two timing runs.

    Raises
    ------
    InputError
        Where the runs have no problem in common.
    """
    import pandas as pd

    left, right = _jobs(old), _jobs(new)
    common = [cell for cell in left if cell in right]
    pairs = {c: (left[c], right[c]) for c in common if left[c].row["instance_key"] == right[c].row["instance_key"]}
    if not pairs:
        why = "; they name the same scenes, but with other data" if common else ""
        raise InputError(f"the two runs have no problem, method and seed in common{why}")
    scenes = _of_scenes(pairs, with_times=not no_times)
    methods = _of_methods(scenes)
    rows = [
        *_judged("all", _of_all(scenes), threshold),
        *_judged("method", methods, threshold),
        *_judged("scene", scenes, threshold),
    ]
    return Comparison(
        pd.DataFrame(rows, columns=list(COLUMNS)),
        tuple(_outcomes(pairs)),
        len(pairs),
        all(_identical(*pair) for pair in pairs.values()),
        tuple(_notes(left, right, len(common) - len(pairs), pairs, no_times)),
    )


def _jobs(results: Results) -> dict[Cell, _Job]:
    """Every job of a run."""
    found = {}
    for row in results.frame.to_dict("records"):
        known = {str(name): value for name, value in row.items()}
        cell = (*(known[name] for name in (*PLACE, *CONFIGURED)), int(known["seed"]))
        found[cell] = _Job(known, results.job_errors.get(known["job"]))
    return found


def _of_scenes(pairs: _Pairs, with_times: bool) -> dict[_Key, "_Compared"]:
    """Ratio of every method on every scene, of each quantity."""
    groups: dict[tuple[Place, Configured], list[tuple[_Job, _Job]]] = {}
    instances: dict[Place, set[str]] = {}
    for (dataset, instance, protocol, method, params, _), pair in pairs.items():
        place: Place = (dataset, instance, protocol)
        instances.setdefault(place, set()).add(pair[0].row["instance_key"])
        groups.setdefault((place, (method, params)), []).append(pair)
    found: dict[_Key, _Compared] = {}
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
class _Compared:
    """Two values and their ratio; `same` where nothing differs."""

    old: float
    new: float
    ratio: Ratio
    same: bool = False


def _errors(scored: Sequence[tuple[Floats, Floats]], statistic: Statistic, same_cameras: bool) -> _Compared:
    """On the cameras that both runs have scored."""
    old, new = padded([a for a, _ in scored]), padded([b for _, b in scored])
    ratio = error_ratio(new, old, statistic, same_cameras=same_cameras)
    same = np.array_equal(old, new, equal_nan=True)
    table = np.stack([old, new])
    table = np.where(np.isfinite(table).all(axis=0), table, np.nan)
    before, after = np.nanmean(seed_scores(table, CENTRES[statistic]), axis=1) if np.isfinite(table).any() else NEITHER
    return _Compared(float(before), float(after), ratio, same)


def _times(timed: Sequence[tuple[Floats, Floats]]) -> _Compared:
    """Of one seed its rounds are compared, of several the seeds' ratios."""
    before, after = (float(np.mean([np.median(pair[k]) for pair in timed])) for k in (0, 1))
    same = all(np.array_equal(a, b) for a, b in timed)
    return _Compared(before, after, mean_ratio([time_ratio(b, a) for a, b in timed]), same)


def _of_methods(scenes: Mapping[_Key, _Compared]) -> dict[_Key, _Compared]:
    """Of every method over its scenes."""
    groups: dict[_Key, list[_Compared]] = {}
    for (_, method, quantity), one in scenes.items():
        groups.setdefault((NOWHERE, method, quantity), []).append(one)
    return {key: _mean(members) for key, members in groups.items()}


def _of_all(scenes: Mapping[_Key, _Compared]) -> dict[_Key, _Compared]:
    """Of all methods together: their mean on each scene, over the scenes."""
    groups: dict[tuple[Place, str], list[_Compared]] = {}
    for (place, _, quantity), one in scenes.items():
        groups.setdefault((place, quantity), []).append(one)
    by_quantity: dict[_Key, list[_Compared]] = {}
    for (_, quantity), members in groups.items():
        whole = replace(_mean(members), ratio=Ratio(_geometric([one.ratio.value for one in members])))
        by_quantity.setdefault((NOWHERE, (ALL, ""), quantity), []).append(whole)
    return {key: _mean(members) for key, members in by_quantity.items()}


def _mean(members: Sequence[_Compared]) -> _Compared:
    return _Compared(
        _geometric([one.old for one in members]),
        _geometric([one.new for one in members]),
        mean_ratio([one.ratio for one in members]),
        all(one.same for one in members),
    )


def _geometric(values: Sequence[float]) -> float:
    return float(np.exp(np.mean(np.log(np.maximum(values, SMALLEST)))))


def _judged(level: str, found: Mapping[_Key, _Compared], threshold: float) -> Iterator[Row]:
    p_values = holm([np.nan if one.same else one.ratio.p_value for one in found.values()])
    for ((place, (method, params), quantity), one), of_level in zip(found.items(), p_values, strict=True):
        ratio, p = one.ratio, float(np.minimum(LEVELS * of_level, 1))
        verdict = IDENTICAL if one.same else ratio.verdict(p, threshold)
        head = (level, *place, method, params, quantity)
        values = (one.old, one.new, ratio.value, ratio.low, ratio.high, ratio.p_value, p, verdict)
        yield dict(zip(COLUMNS, (*head, *values), strict=True))


def _outcomes(pairs: _Pairs) -> Iterator[Change]:
    for cell, (old, new) in pairs.items():
        if old.ended != new.ended:
            yield Change(cell, str(old.row["status"]), str(new.row["status"]), old.ended == OK)
        elif old.ended == OK and old.row["n_solved"] != new.row["n_solved"]:
            before, after = (int(job.row["n_solved"]) for job in (old, new))
            yield Change(cell, f"{before} cameras solved", f"{after}", after < before)


def _identical(old: _Job, new: _Job) -> bool:
    if old.ended != new.ended or old.row["n_solved"] != new.row["n_solved"]:
        return False
    if old.errors is None or new.errors is None:
        return _unscored(old) == _unscored(new)
    return np.array_equal(old.errors, new.errors, equal_nan=True)


def _unscored(job: _Job) -> tuple[str, ...]:
    """What is known of an estimate without ground truth; as text, because NaN is not NaN."""
    return tuple(str(job.row.get(name)) for name in ("residual_mean_deg", "residual_median_deg"))


def _notes(
    left: Mapping[Cell, _Job], right: Mapping[Cell, _Job], changed: int, pairs: _Pairs, no_times: str
) -> Iterator[str]:
    for one, other, name in ((left, right, "first"), (right, left, "second")):
        if missing := len(one.keys() - other.keys()):
            yield f"{missing} jobs are only in the {name} run: not compared"
    if changed:
        yield f"{changed} jobs are on data that have changed: not compared"
    if unscored := sum(a.ended == b.ended == OK and a.errors is None for a, b in pairs.values()):
        yield f"{unscored} jobs have no ground truth: only how they ended is compared"
    if no_times:
        yield f"times are not compared: {no_times}"
