"""One number for each method and each problem, for comparisons over many problems."""

from dataclasses import dataclass
from itertools import compress
from typing import TYPE_CHECKING

import numpy as np

from bench.core import outcome
from bench.core.problem import Floats
from bench.scoring.inference.resampling import FLOOR_DEG
from bench.scoring.inference.statistics import MIN_COVERAGE

if TYPE_CHECKING:
    import pandas as pd

Configured = tuple[str, str]  # method, params

LEAST_BLOCKS = 2
_PLACE = ["dataset", "instance"]


@dataclass(frozen=True, eq=False)
class Blocks:
    """A complete table of methods and independent problems.

    Parameters
    ----------
    methods
        (k,) the configured methods that were run on every problem.
    values
        (b, k) what is compared, smaller being better; infinite where a method failed.
    scenes
        (b,) number of the scene that each problem is of: problems of one scene differ by their seed.
    left_out
        Configured methods that were not run on every problem.
    """

    methods: tuple[Configured, ...]
    values: Floats
    scenes: tuple[int, ...]
    left_out: tuple[Configured, ...] = ()

    @property
    def weights(self) -> Floats:
        """(b,) share of each problem in a mean over all: a scene counts once, however many problems its seeds make."""
        _, scene, problems = np.unique(self.scenes, return_inverse=True, return_counts=True)
        shares: Floats = 1 / (len(problems) * problems[scene])
        return shares

    @property
    def enough(self) -> bool:
        """Whether there are methods and problems to compare."""
        return len(self.methods) > 1 and len(self.values) >= LEAST_BLOCKS


DID_NOT_RUN = (outcome.NOT_INSTALLED, outcome.NOT_RUN)


def headline(frame: "pd.DataFrame") -> "pd.DataFrame":
    """The rows that findings are about: of one protocol, the first, where a scene was run under several."""
    several = frame.groupby(_PLACE)["protocol"].nunique().gt(1).any()
    return frame[frame["protocol"] == frame["protocol"].iloc[0]] if several else frame


def blocks(frame: "pd.DataFrame", column: str = "median_deg", floor: float = FLOOR_DEG) -> Blocks:
    """Gather scored rows into independent problems.

    A block is an instance. Seeds that share one are not independent of each other: they are averaged,
    geometrically; nor is a scene under another protocol, see `headline`. Where the instance changes with the seed,
    every seed is a block of its own. A job that failed, and one that scored less than 95 % as many cameras as the most
    complete one, is worse than all that did not. Problems without ground truth, or that nobody solved, are left out,
    and so are methods that did not run everywhere, for want of their package or of time: that says nothing of them.

    Parameters
    ----------
    frame
        Scored rows, see `bench.scoring.results.Results.frame`.
    column
        ``median_deg``, ``mean_deg`` or ``solve_s``.
    floor
        Values below it count as it.
    """
    return _blocks(_table(headline(frame), column, floor))


def by_scene(frame: "pd.DataFrame") -> dict[tuple[str, str], Blocks]:
    """The blocks of median errors of each scene, by dataset and instance; rows of one protocol."""
    table = _table(frame, "median_deg", FLOOR_DEG)
    found = {}
    for place in dict.fromkeys(table.places):
        own = table.values[[here == place for here in table.places]]
        run = [not np.isnan(values).all() for values in own.T]
        found[place] = _blocks(_Table([place] * len(own), list(compress(table.methods, run)), own[:, run]))
    return found


@dataclass(frozen=True, eq=False)
class _Table:
    """Logarithms (b, k) of a problem (row) and a configured method, infinite where it failed, NaN where it was not run.

    The places are those of the problems.
    """

    places: list[tuple[str, str]]
    methods: list[Configured]
    values: Floats


def _table(frame: "pd.DataFrame", column: str, floor: float) -> _Table:
    import pandas as pd

    scored = pd.to_numeric(frame["n_scored"])
    most = scored.groupby([frame[name] for name in ("dataset", "instance", "protocol")]).transform("max")
    whole = (frame["outcome"] == outcome.OK) & (scored > 0) & (scored >= MIN_COVERAGE * most)
    value = np.log(pd.to_numeric(frame[column], errors="coerce").clip(lower=floor)).where(whole, np.inf)
    instances = frame.groupby([*_PLACE, "protocol"])["instance_key"].transform("nunique")
    draw = frame["seed"].where(instances > 1, -1)  # the seed where the instance changes with it
    rows = frame[["dataset", "instance", "method", "params"]].assign(draw=draw, value=value.fillna(np.inf))
    rows = rows[(most > 0) & ~frame["outcome"].isin(DID_NOT_RUN)]
    means = rows.groupby([*_PLACE, "draw", "method", "params"], sort=False)["value"].mean()
    keys = [(str(d), str(i), int(draw), str(m), str(p)) for d, i, draw, m, p in means.index]
    problems, methods = list(dict.fromkeys(k[:3] for k in keys)), list(dict.fromkeys(k[3:] for k in keys))
    values = np.full((len(problems), len(methods)), np.nan)
    at = {key: k for several in (problems, methods) for k, key in enumerate(several)}
    for key, mean in zip(keys, means.to_numpy(), strict=True):
        values[at[key[:3]], at[key[3:]]] = mean
    solved = [bool(np.isfinite(row).any()) for row in values]
    return _Table([problem[:2] for problem in compress(problems, solved)], methods, values[solved])


def _blocks(table: _Table) -> Blocks:
    complete = [not np.isnan(values).any() for values in table.values.T]
    scenes = list(dict.fromkeys(table.places))
    return Blocks(
        tuple(compress(table.methods, complete)),
        np.exp(table.values[:, complete]),
        tuple(map(scenes.index, table.places)),
        tuple(compress(table.methods, (not whole for whole in complete))),
    )
