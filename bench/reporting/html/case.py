"""What is known of one scene: the problem, the truth, and every estimate with its errors, residuals and folds."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass

import numpy as np

from bench.core.outcome import OK
from bench.core.problem import Floats, Instance
from bench.reporting import appearance
from bench.scoring.metrics.errors import camera_errors
from bench.scoring.metrics.folds import Fold, find_folds
from bench.scoring.metrics.oracle import ORACLE
from bench.scoring.results import Configured, Place, Results
from bench.storage.store import Store


@dataclass(frozen=True, eq=False)
class Solved:
    """One estimate.

    Parameters
    ----------
    key, label
        The configured method, and the selection that runs it.
    rotations
        (n, 3, 3).
    edge_weights
        (m,) or None.
    errors
        (n,) degrees, NaN where not scored.
    residuals
        (m,) degrees, at the estimate; NaN where a camera is not solved.
    folds
        Cameras that share a wrong rotation.
    scores
        Numbers of its row of the results, by column.
    """

    key: Configured
    label: str
    rotations: Floats
    edge_weights: Floats | None
    errors: Floats
    residuals: Floats
    folds: tuple[Fold, ...]
    scores: Mapping[Hashable, float]

    @property
    def quality(self) -> float:
        """Median error, or where there is no truth median residual, degrees."""
        values = self.errors if np.isfinite(self.errors).any() else self.residuals
        return float(np.nanmedian(values))


@dataclass(frozen=True, eq=False)
class Case:
    """One instance of a place with the estimates of all methods that ended well on it.

    Parameters
    ----------
    name
        Of the place, for ids.
    instance
        The problem and the truth.
    at_truth
        (m,) residuals at the truth, degrees; NaN where it is unknown.
    solved
        At least one, the best first.
    several
        Whether the place has more seeds or instances than this one.
    """

    name: str
    instance: Instance
    at_truth: Floats
    solved: tuple[Solved, ...]
    several: bool

    @property
    def has_truth(self) -> bool:
        """Whether any residual at the truth is known."""
        return bool(np.isfinite(self.at_truth).any())


def gather(store: Store, results: Results, place: Place) -> Case | None:
    """Read what a run has stored of a place; None where nothing ended well.

    Where seeds have instances of their own, the first is taken, and of each method its first seed on it.
    """
    frame = results.frame
    here = (frame["dataset"] == place[0]) & (frame["instance"] == place[1]) & (frame["protocol"] == place[2])
    rows = frame[here & (frame["outcome"] == OK) & (frame["stop_reason"] != ORACLE)]
    if rows.empty:
        return None
    key_of = {job.id: job.instance_key for job in store.jobs()}
    key = key_of[rows["job"].iloc[0]]
    instance = store.instance(key)
    problem = instance.problem
    first = rows[rows["job"].map(key_of) == key].drop_duplicates(["method", "params"])
    truth = np.full((problem.n, 3, 3), np.nan) if instance.truth is None else instance.truth
    solved = []
    for row in first.to_dict("records"):
        estimate = store.estimate(row["job"])
        solved.append(
            Solved(
                (row["method"], row["params"]),
                appearance.current().called(row["method"], row["params"]),
                estimate.rotations,
                estimate.edge_weights,
                camera_errors(estimate.rotations, truth, results.alignment),
                np.degrees(problem.residuals(estimate.rotations)),
                find_folds(estimate.rotations, truth),
                row,
            )
        )
    solved.sort(key=lambda s: s.quality)
    at_truth = np.degrees(problem.residuals(truth))
    return Case("-".join(place), instance, at_truth, tuple(solved), len(rows) > len(first))
