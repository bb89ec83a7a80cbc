"""One number for each method and each problem, for comparisons over many problems."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

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
    def enough(self) -> bool:
        """Whether there are methods and problems to compare."""
        return len(self.methods) > 1 and len(self.values) >= LEAST_BLOCKS


_DID_NOT_RUN = ("not-installed", "not-run")


def blocks(frame: "pd.DataFrame", column: str = "median_deg", floor: float = FLOOR_DEG) -> Blocks:
    """Gather scored rows into independent problems.

    A block is an instance. Seeds that share one are not independent of each other, nor is a scene under another
    protocol: they are averaged, geometrically. Where the instance changes with the seed, every seed is a block of
    its own. A job that failed, and one that scored less than 95 % as many cameras as the most complete one, is worse
    than all that did not. Problems without ground truth, or that nobody solved, are left out, and so are methods that
    did not run everywhere, for want of their package or of time: that says nothing of them.

    Parameters
    ----------
    frame
        Scored rows, see `bench.scoring.results.Results.frame`.
    column
        ``median_deg``, ``mean_deg`` or ``solve_s``.
    floor
        Values below it count as it.
    """
    import pandas as pd

    scored = pd.to_numeric(frame["n_scored"])
    most = scored.groupby([frame[name] for name in ("dataset", "instance", "protocol")]).transform("max")
    whole = (frame["status"] == "ok") & (scored > 0) & (scored >= MIN_COVERAGE * most)
    value = np.log(pd.to_numeric(frame[column], errors="coerce").clip(lower=floor)).where(whole, np.inf)
    rows = frame[["dataset", "instance", "method", "params"]].assign(draw=_draws(frame), value=value.fillna(np.inf))
    rows = rows[(most > 0) & ~frame["status"].str.startswith(_DID_NOT_RUN)]
    keys = ["dataset", "instance", "draw"]
    if rows.empty:
        return Blocks((), np.empty((0, 0)), ())
    wide = rows.groupby([*keys, "method", "params"], sort=False)["value"].mean().unstack(["method", "params"])
    wide = wide[np.isfinite(wide).any(axis=1)]
    complete = wide.notna().all()
    place = wide.index.droplevel("draw")
    return Blocks(
        tuple(wide.columns[complete]),
        np.exp(wide.loc[:, complete].to_numpy()),
        tuple(int(code) for code in pd.factorize(place)[0]),
        tuple(wide.columns[~complete]),
    )


def _draws(frame: "pd.DataFrame") -> "pd.Series":
    """The seed where the instance changes with it, otherwise -1."""
    instances = frame.groupby([*_PLACE, "protocol"])["instance_key"].transform("nunique")
    return frame["seed"].where(instances > 1, -1)
