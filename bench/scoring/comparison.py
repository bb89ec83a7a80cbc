"""Two runs of the same problems, one against the other: what became better, worse, or cannot be told."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bench.core.errors import InputError
from bench.core.outcome import OK
from bench.core.words import counted
from bench.plugins.selection import label
from bench.scoring.inference.ratio import Ratio
from bench.scoring.paired import (
    COLUMNS,
    NOWHERE,
    Cell,
    Compared,
    Job,
    Key,
    Pairs,
    geometric,
    jobs_of,
    judged,
    mean,
    of_methods,
    of_scenes,
)
from bench.scoring.results import Place, Results

if TYPE_CHECKING:
    import pandas as pd

ALL = "all"
LEVELS = 3  # that a verdict is given at: all, method and scene


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
        `bench.scoring.paired.COLUMNS`; level "all" is everything together, "method" a method over its scenes, "scene" a
        method on a scene. A quantity is "median", "mean" or "time"; `ratio` is new to old, with its 95 %
        interval; `p_holm` is corrected for all rows.
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

    left, right = jobs_of(old), jobs_of(new)
    common = [cell for cell in left if cell in right]
    pairs = {c: (left[c], right[c]) for c in common if left[c].row["instance_key"] == right[c].row["instance_key"]}
    if not pairs:
        why = "; they name the same scenes, but with other data" if common else ""
        raise InputError(f"the two runs have no problem, method and seed in common{why}")
    scenes = of_scenes(pairs, with_times=not no_times)
    methods = of_methods(scenes)
    rows = [
        *judged("all", _of_all(scenes), threshold, LEVELS),
        *judged("method", methods, threshold, LEVELS),
        *judged("scene", scenes, threshold, LEVELS),
    ]
    return Comparison(
        pd.DataFrame(rows, columns=list(COLUMNS)),
        tuple(_outcomes(pairs)),
        len(pairs),
        all(_identical(*pair) for pair in pairs.values()),
        tuple(_notes(left, right, len(common) - len(pairs), pairs, no_times)),
    )


def _of_all(scenes: Mapping[Key, Compared]) -> dict[Key, Compared]:
    """Of all methods together: their mean on each scene, over the scenes."""
    groups: dict[tuple[Place, str], list[Compared]] = {}
    for (place, _, quantity), one in scenes.items():
        groups.setdefault((place, quantity), []).append(one)
    by_quantity: dict[Key, list[Compared]] = {}
    for (_, quantity), members in groups.items():
        whole = replace(mean(members), ratio=Ratio(geometric([one.ratio.value for one in members])))
        by_quantity.setdefault((NOWHERE, (ALL, ""), quantity), []).append(whole)
    return {key: mean(members) for key, members in by_quantity.items()}


def _outcomes(pairs: Pairs) -> Iterator[Change]:
    for cell, (old, new) in pairs.items():
        if old.ended != new.ended:
            yield Change(cell, str(old.row["status"]), str(new.row["status"]), old.ended == OK)
        elif old.ended == OK and old.row["n_solved"] != new.row["n_solved"]:
            before, after = (int(job.row["n_solved"]) for job in (old, new))
            yield Change(cell, f"{before} cameras solved", f"{after}", after < before)


def _identical(old: Job, new: Job) -> bool:
    if old.ended != new.ended or old.row["n_solved"] != new.row["n_solved"]:
        return False
    if old.errors is None or new.errors is None:
        return _unscored(old) == _unscored(new)
    return np.array_equal(old.errors, new.errors, equal_nan=True)


def _unscored(job: Job) -> tuple[str, ...]:
    """What is known of an estimate without ground truth; as text, because NaN is not NaN."""
    return tuple(str(job.row.get(name)) for name in ("residual_mean_deg", "residual_median_deg"))


def _notes(
    left: Mapping[Cell, Job], right: Mapping[Cell, Job], changed: int, pairs: Pairs, no_times: str
) -> Iterator[str]:
    for one, other, name in ((left, right, "first"), (right, left, "second")):
        if missing := len(one.keys() - other.keys()):
            yield f"{counted(missing, 'job is', 'jobs are')} only in the {name} run: not compared"
    if changed:
        yield f"{counted(changed, 'job is', 'jobs are')} on data that have changed: not compared"
    if unscored := sum(a.ended == b.ended == OK and a.errors is None for a, b in pairs.values()):
        yield f"{counted(unscored, 'job has', 'jobs have')} no ground truth: only how they ended is compared"
    if no_times:
        yield f"times are not compared: {no_times}"
