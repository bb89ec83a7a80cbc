"""Folders of runs that no method has run: made for tests of what is drawn from them."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.core import so3
from bench.core.digest import digest
from bench.core.limits import Limits
from bench.core.outcome import Outcome
from bench.core.problem import Checkpoint, Estimate, Floats, Instance
from bench.storage.arrays import save_estimate
from bench.storage.record import Moment, Record, Report
from bench.storage.store import Store
from bench.suite.plan import Job, Plan
from tests.graphs import random_edges, simulated

Errors = Callable[[np.random.Generator, int], Floats]  # degrees (n,)


@dataclass(frozen=True)
class Made:
    """A method as it shows in a run.

    Parameters
    ----------
    name, seconds
        Its id, and how long it takes.
    scale_deg
        Size of its errors, which have a tail.
    fold_deg
        Angle by which the first quarter of the cameras is turned.
    status, log
        How its jobs end, and what they print.
    only
        The scenes that the status is about; all where empty.
    checkpoints
        How many it gives.
    """

    name: str
    scale_deg: float = 1.0
    seconds: float = 0.1
    fold_deg: float = 0.0
    status: str = "ok"
    log: str = ""
    only: tuple[str, ...] = ()
    checkpoints: int = 0


def made_run(
    folder: Path,
    scenes: Sequence[str],
    methods: Sequence[Made],
    *,
    cameras: int = 40,
    share: float = 0.3,
    seeds: int = 1,
    protocols: Sequence[str] = ("all",),
    suite: str = "made",
    dataset: str = "toy",
) -> Store:
    """A finished run: errors are drawn, estimates are stored as a method would have returned them."""
    store = Store(folder)
    jobs = []
    for k, (scene, protocol) in enumerate((s, p) for s in scenes for p in protocols):
        problem, truth = simulated(random_edges(cameras, share, k), noise_deg=1.0, outliers=0.1, seed=k)
        key = digest([scene, protocol, k])
        store.add_instance(key, Instance(problem, truth, scene, protocol=protocol))
        for method in methods:
            for seed in range(seeds):
                label = f"{dataset}[protocol={protocol}]"
                identity = digest([key, method.name, seed])
                job = Job(identity, label, scene, key, method.name, method.name, "made", {}, seed)
                rng = np.random.default_rng([k, seed, sum(method.name.encode())])
                _finish(store, job, method, truth, rng)
                jobs.append(job)
    store.add_plan(Plan(suite, tuple(jobs), (), f"python -m bench run --suite {suite}"))
    return store


def _finish(store: Store, job: Job, method: Made, truth: Floats, rng: np.random.Generator) -> None:
    status = method.status if not method.only or job.instance in method.only else "ok"
    kind, _, detail = status.partition("(")
    record = Record(
        job,
        Outcome(kind, detail.removesuffix(")")),  # type: ignore[arg-type]
        Limits(60, 4),
        finished=f"2026-01-01T00:00:0{job.seed}+00:00",
        versions={"numpy": "2.0", method.name: "1.0"},
        provenance={"bench": "0.1.0", "git": "abc", "python": "3.11", "cpu": "a CPU", "host": "a host"},
        log=method.log,
    )
    if not record.outcome.ok:
        store.add_record(record, None)
        return
    steps = [_turned(truth, method, rng, 1 + 2.0 * k) for k in range(method.checkpoints, -1, -1)]
    moments = tuple(Moment(10 * k, method.seconds * k) for k in range(method.checkpoints))
    states = tuple(Checkpoint(m.iteration, m.seconds, state) for state, m in zip(steps, moments, strict=False))
    report = Report(solve_s=method.seconds, peak_mib=3.0, checkpoints=moments, iterations=7)
    with store.work_folder() as work:
        path = work / "estimate.npz"
        save_estimate(path, Estimate(steps[-1], checkpoints=states))
        store.add_record(dataclasses.replace(record, report=report), path)


def _turned(truth: Floats, method: Made, rng: np.random.Generator, factor: float) -> Floats:
    """The truth with errors of a gamma distribution about random axes, and a fold."""
    n = len(truth)
    axes = rng.standard_normal((n, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = np.radians(factor * method.scale_deg * rng.gamma(2.0, 0.5, n))
    folded = np.where(np.arange(n)[:, None] < n // 4, np.radians(method.fold_deg) * np.array([0.0, 0.0, 1.0]), 0.0)
    turned: Floats = so3.exp(angles[:, None] * axes) @ truth @ so3.exp(folded)
    return turned
