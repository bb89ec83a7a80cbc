"""Fill a run's folder with records as a sweep would, to time what reads them.

    python tests/tools/generate_records.py FOLDER 1000000
    time python -m bench table FOLDER

Truths, measurements and estimates are random and small (five cameras, all connected); every instance,
record and estimate goes through the store like that of a real run.
"""

import sys
from pathlib import Path

import numpy as np

from bench.core import so3
from bench.core.digest import digest
from bench.core.limits import Limits
from bench.core.outcome import OK, TIMEOUT, Outcome
from bench.core.problem import Estimate, Instance, Problem
from bench.storage.arrays import save_estimate
from bench.storage.record import Record, Report
from bench.storage.store import Store
from bench.suite.plan import Job, Plan

CAMERAS, DATASETS, METHODS = 5, 10, 10


def generate(folder: Path, count: int) -> None:
    """Write `count` jobs of 10 datasets x 10 methods x seeds, one in a hundred of which ended in a timeout."""
    store = Store(folder)
    rng = np.random.default_rng(0)
    jobs = []
    with store.work_folder() as work:
        for k in range(count // METHODS):
            seed, dataset = divmod(k, DATASETS)
            key = digest([dataset, seed])
            truth = so3.random(rng, CAMERAS)
            store.add_instance(key, complete(truth, rng, f"complete{dataset}"))
            for method in range(METHODS):
                names = (f"method-{method}", f"Method {method}", "bench.methods.spectral", {"step": method})
                job = Job(digest([key, method]), f"complete[k={dataset}]", f"complete{dataset}", key, *names, seed)
                jobs.append(job)
                add_record(store, job, truth, rng, work, failed=rng.random() < 0.01)
    store.add_plan(Plan("generated", tuple(jobs), command="generated"))


def complete(truth: np.ndarray, rng: np.random.Generator, name: str) -> Instance:
    """Every pair of cameras, measured within a degree or two."""
    i, j = np.triu_indices(CAMERAS, k=1)
    noise = so3.exp(0.02 * rng.normal(size=(len(i), 3)))
    edges = np.stack([i, j], axis=1)
    return Instance(Problem(CAMERAS, edges, noise @ truth[i] @ truth[j].transpose(0, 2, 1)), truth, name)


def add_record(
    store: Store, job: Job, truth: np.ndarray, rng: np.random.Generator, work: Path, *, failed: bool
) -> None:
    """Keep a record of realistic size, and an estimate a few degrees from the truth."""
    record = Record(
        job,
        Outcome(TIMEOUT, "60 s") if failed else Outcome(OK),
        Limits(60.0, 8.0),
        finished="2026-01-01T00:00:00+00:00",
        versions={"numpy": "2.0", "scipy": "1.13"},
        provenance={"command": "python -m bench run", "cpu": 40 * "x", "platform": 60 * "x", "git": 40 * "0"},
        report=Report() if failed else Report(1, solve_s=0.001 * rng.lognormal(), peak_mib=1.5, iterations=12),
        wall_s=0.02,
    )
    if failed:
        store.add_record(record, None)
        return
    noise = so3.exp(0.002 * (1 + job.parameters["step"]) * rng.normal(size=(CAMERAS, 3)))
    save_estimate(work / "estimate.npz", Estimate(noise @ truth))
    store.add_record(record, work / "estimate.npz")


if __name__ == "__main__":
    generate(Path(sys.argv[1]), int(sys.argv[2]))
