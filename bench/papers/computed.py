"""What has been computed for an item of a paper."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from bench.core import outcome
from bench.core.errors import InputError
from bench.core.problem import Instance
from bench.plugins import selection
from bench.plugins.catalog import catalog
from bench.scoring.metrics.oracle import ORACLE, Curve
from bench.scoring.results import Results
from bench.suite.plan import Job


@dataclass(frozen=True)
class Score:
    """A job, or the oracle's pick of it, as items read it; NaN where it has no such number.

    Parameters
    ----------
    dataset, instance, method, seed
        The job; dataset and method as selections.
    status, oracle
        How it ended, and whether this is the checkpoint that ground truth likes best.
    notes
        What the method said of it.
    """

    dataset: str
    instance: str
    method: str
    seed: int = 0
    status: str = outcome.OK
    oracle: bool = False
    mean_deg: float = np.nan
    median_deg: float = np.nan
    rms_deg: float = np.nan
    solve_s: float = np.nan
    iterations: float = np.nan
    n_cameras: float = np.nan
    n_scored: float = np.nan
    edges_percent: float = np.nan
    hardness: float = np.nan
    notes: str = ""

    @property
    def ok(self) -> bool:
        """Whether it ended well."""
        return self.status == outcome.OK


NUMBERS = [f.name for f in fields(Score) if f.type is float]


@dataclass(frozen=True)
class Computed:
    """Jobs with their scores.

    Parameters
    ----------
    alignment
        The rule that removed the gauge.
    jobs, scores
        Those of the item, and no others of the run's folder.
    curves
        For each method, as a selection, the errors along its checkpoints, where they were asked for.
    notes
        For each instance, what a reader must know of it.
    missing
        A sentence for what is not on disk.
    instance
        Reads the instance of a job.
    plugins
        Files with more methods, which `spelled` knows.
    recorded
        Where nothing was computed, a sentence that says what the numbers are; else "".
    """

    alignment: str
    jobs: Sequence[Job] = ()
    scores: Sequence[Score] = ()
    curves: Mapping[str, Sequence[Curve]] = field(default_factory=dict)
    notes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    missing: Sequence[str] = ()
    instance: Callable[[Job], Instance] | None = None
    plugins: Sequence[str | Path] = ()
    recorded: str = ""

    def spelled(self, method: str) -> str:
        """The selection of a method as its jobs spell it."""
        return selection.format_selection(*one("method", method, self.plugins))

    def remarks(self) -> Iterator[str]:
        """What was not computed and what is not on disk, as notes below a table."""
        if self.recorded:
            yield self.recorded
        yield from (f"{sentence[0].upper()}{sentence[1:]}." for sentence in self.missing)


def scores_of(results: Results, jobs: Sequence[Job]) -> Iterator[Score]:
    """The rows of a scored run as objects, for each of these jobs; two may be one under different spellings."""
    rows: dict[str, list[dict[Hashable, Any]]] = {}
    for row in results.frame.to_dict("records"):
        rows.setdefault(row["job"], []).append(row)
    for job in jobs:
        for row in rows[job.id]:
            yield Score(
                job.dataset,
                job.instance,
                job.label,
                job.seed,
                row["status"],
                row["stop_reason"] == ORACLE,
                notes=row["notes"],
                **{name: np.nan if row[name] is None else float(row[name]) for name in NUMBERS},
            )


def one(kind: str, text: str, plugins: Sequence[str | Path] = ()) -> tuple[str, dict[str, Any]]:
    """Name and given parameters of a selection that stands for one configuration."""
    info, parameters = catalog(kind, plugins).one(text)
    return info.name, parameters


def label(kind: str, text: str) -> str:
    """The selection as a run spells it."""
    return selection.format_selection(*one(kind, text))


def extended(text: str, parameters: Mapping[str, Any]) -> str:
    """A selection with further parameters."""
    parsed = selection.parse(text)
    combinations = parsed.combinations()
    if len(combinations) != 1:
        raise InputError(f"a layout names one dataset at a time, and '{text}' stands for {len(combinations)}")
    return selection.format_selection(parsed.name, {**combinations[0], **parameters})
