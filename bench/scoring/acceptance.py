"""Whether a run is what a working method gives: how jobs ended, which cameras they solved, how wrong they are."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.core import outcome
from bench.core.outcome import OK
from bench.plugins.catalog import catalog
from bench.scoring.results import Results
from bench.storage.store import Store
from bench.suite.plan import Job

LIMIT = "limit_deg"  # among the statistics of an instance: the median error that a working method stays below


@dataclass(frozen=True)
class Failure:
    """A job that is not as it should be, and why."""

    job: Job
    why: str

    def __str__(self) -> str:
        """A line."""
        return f"{self.job.label} on {self.job.instance}, seed {self.job.seed}: {self.why}"


def failures(
    store: Store, results: Results, jobs: Sequence[Job], plugins: Sequence[Path] = (), *, needed: bool = False
) -> Iterator[Failure]:
    """What is wrong with the jobs of a run.

    A job must end well, solve the whole largest component of its graph and, where its instance has a limit, keep its
    median error below. A limit holds for methods that declare to be robust, and for all where there are no outliers. A
    job that a method declines is no failure.

    Parameters
    ----------
    store, results, jobs
        The run, scored, and which of its jobs.
    plugins
        Files with more methods.
    needed
        Whether a package that is not installed is a failure too.
    """
    known = catalog("method", plugins)
    rows = {row["job"]: row for row in results.frame.to_dict("records")}
    for job in jobs:
        row = rows[job.id]
        if row["outcome"] == outcome.SKIPPED or (row["outcome"] == outcome.NOT_INSTALLED and not needed):
            continue
        info = known[job.method]
        robust = bool(info.fact("robust", info.configure(job.parameters)))
        if why := _wrong(store, job, row, robust):
            yield Failure(job, why)


def _wrong(store: Store, job: Job, row: dict[Any, Any], robust: bool) -> str:
    """Why a job is a failure; "" where it is none."""
    if row["outcome"] != OK:
        return str(row["status"])
    instance = store.instance(job.instance_key)
    cameras = int((instance.problem.components == 0).sum())
    if row["n_solved"] < cameras:
        return f"{row['n_solved']} of {cameras} cameras solved"
    limit = instance.statistics.get(LIMIT)
    outlying = instance.outliers is not None and bool(instance.outliers.any())
    if limit is not None and (robust or not outlying) and not row["median_deg"] <= limit:
        return f"median error {row['median_deg']:.3g} degrees, where a working method stays below {limit:g}"
    return ""
