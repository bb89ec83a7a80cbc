"""What earlier runs tell about how long the jobs of a run will take."""

import contextlib
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from bench.core.errors import InputError
from bench.running.progress.pace import Pace, Task
from bench.running.run import Run
from bench.storage.store import Store
from bench.suite.plan import Job

OTHER_RUNS = 3  # that are looked at, newest first
MOST_RECORDS = 300  # read of each run
FEWEST_RECORDS = 5  # of each configured method, where there are that many
MOST_PLANNED = 20_000_000  # bytes of plans, beyond which reading another run costs more than it tells


class Past:
    """Times of earlier jobs, in the run's own folder and in those beside it.

    Parameters
    ----------
    planned, further
        The run whose jobs are to be timed, and others in the same folder.
    """

    def __init__(self, planned: Run, *further: Run) -> None:
        self.stores = [planned.store, *_beside(planned.store.folder)]
        self.pace = Pace()
        self._sizes: dict[str, float] = {}
        wanted = {cell.job.method for run in (planned, *further) for cell in run.cells}
        for store in self.stores:
            by_method: dict[str, list[Job]] = {}
            with contextlib.suppress(InputError):  # plans that cannot be read tell nothing
                for job in store.jobs():
                    if job.method in wanted and (job.rounds > 0) == planned.options.timing:
                        by_method.setdefault(self.task(job).configured, []).append(job)
            for jobs in by_method.values():
                self._read(store, jobs, MOST_RECORDS // len(by_method))

    def task(self, job: Job) -> Task:
        """A job as far as its time is concerned."""
        key = job.instance_key
        if math.isnan(self._sizes.get(key, math.nan)):
            self._sizes[key] = self._size(key)
        return Task(job.method, job.label, self._sizes[key])

    def _read(self, store: Store, jobs: Sequence[Job], most: int) -> None:
        for job in jobs[:: -(-len(jobs) // max(most, FEWEST_RECORDS))]:
            with contextlib.suppress(InputError):  # a record that cannot be read tells nothing
                if record := store.record(job.id):
                    self.pace.see(self.task(job), record)

    def _size(self, key: str) -> float:
        """Bytes of the stored problem, which go with its edges; NaN where no run has stored it."""
        for store in self.stores:
            try:
                return float(store.problem_path(key).stat().st_size)
            except OSError:
                continue
        return math.nan


def _beside(folder: Path) -> Iterator[Store]:
    """The newest other runs in the same parent folder."""
    try:
        others = [path for path in folder.parent.iterdir() if path != folder and (path / "plans").is_dir()]
        others.sort(key=lambda path: (path / "plans").stat().st_mtime, reverse=True)
    except OSError:
        return
    for path in others[:OTHER_RUNS]:
        if sum(file.stat().st_size for file in (path / "plans").rglob("*") if file.is_file()) <= MOST_PLANNED:
            with contextlib.suppress(InputError):
                yield Store.open(path)
