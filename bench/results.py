"""Score what a run has stored: the table of rows, the per-camera errors behind it, ties and footnotes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import selection
from bench.execution import outcome
from bench.problem import Floats, Instance
from bench.scoring.errors import camera_errors, edge_metrics, summary
from bench.scoring.oracle import ORACLE, Curve, curve
from bench.scoring.roc import roc_auc
from bench.scoring.statistics import tie_groups
from bench.scoring.timing import speedup
from bench.store import Job, Store

if TYPE_CHECKING:
    import pandas as pd

Place = tuple[str, str, str]  # dataset, instance, protocol
Configured = tuple[str, str]  # method, params


@dataclass(frozen=True)
class Results:
    """A scored run.

    Parameters
    ----------
    frame
        One row for each (instance, method, parameters, seed) that was planned, whatever became of it.
    errors
        For each place and each configured method, its per-camera errors (n,) in degrees, one array a seed.
    ties
        For each place, the configured methods that cannot be told apart from the best.
    footnotes
        What a reader must know: notes on instances, and data that were not found.
    alignment
        The rule that removed the gauge.
    curves
        For each place and each configured method that gave checkpoints, the errors along them, one curve a seed; empty
        where they were not asked for.
    """

    frame: "pd.DataFrame"
    errors: Mapping[Place, Mapping[Configured, tuple[Floats, ...]]]
    ties: Mapping[Place, set[Configured]]
    footnotes: tuple[str, ...]
    alignment: str
    curves: Mapping[Place, Mapping[Configured, Sequence[Curve]]]


@dataclass
class _Collected:
    rows: list[dict[str, Any]] = field(default_factory=list)
    errors: dict[Place, dict[Configured, list[Floats]]] = field(default_factory=dict)
    instances_of: dict[Place, set[str]] = field(default_factory=dict)
    notes: dict[str, None] = field(default_factory=dict)
    curves: dict[Place, dict[Configured, list[Curve]]] = field(default_factory=dict)


def score(
    store: Store,
    rule: str = "l1",
    protocol: str | None = None,
    jobs: Sequence[Job] | None = None,
    *,
    oracle: bool = False,
    checkpoints: bool = False,
) -> Results:
    """Score what is stored of a run; nothing is run.

    Parameters
    ----------
    store
        The run.
    rule
        One of `bench.scoring.alignment.RULES`.
    protocol
        Keep the instances of one protocol only, and those of datasets that have none.
    jobs
        Only these; by default every job that was ever planned.
    checkpoints
        Score the checkpoints too, which takes their number times as long, for `Results.curves`.
    oracle
        Score them and add a row for the best checkpoint of every estimate that has checkpoints. Its parameters end in
        ``oracle``, and it takes no part in ties.
    """
    import pandas as pd

    collected = _Collected()
    instances: dict[str, Instance] = {}
    for job in store.jobs() if jobs is None else jobs:
        key = job.instance_key
        if key not in instances:
            instances[key] = store.instance(key)
        if protocol in (None, instances[key].protocol) or instances[key].protocol == "all":
            _collect(collected, store, job, instances[key], rule, oracle, checkpoints or oracle)
    plans = store.plans()
    footnotes = [*collected.notes, *(plans[-1].missing if plans else ())]
    if any("timing" in row for row in collected.rows):
        _compare_times(collected.rows, plans[-1].baseline)
    ties = {
        place: tied(by_method, same_cameras=len(collected.instances_of[place]) == 1)
        for place, by_method in collected.errors.items()
    }
    errors = {place: {m: tuple(e) for m, e in by_method.items()} for place, by_method in collected.errors.items()}
    return Results(pd.DataFrame(collected.rows), errors, ties, tuple(footnotes), rule, collected.curves)


def _collect(
    collected: _Collected,
    store: Store,
    job: Job,
    instance: Instance,
    rule: str,
    oracle: bool,
    checkpoints: bool,
) -> None:
    dataset = selection.parse(job.dataset).name
    place = (dataset, job.instance, instance.protocol)
    method = (job.method, selection.format_parameters(dict(job.parameters)))
    collected.instances_of.setdefault(place, set()).add(job.instance_key)
    collected.notes |= {f"{dataset}/{job.instance}: {note}": None for note in instance.notes}

    record = store.record(job.id) or {"outcome": outcome.NOT_RUN, "status": outcome.NOT_RUN}
    errors = np.full(instance.problem.n, np.nan)
    scores: dict[str, Any] = {"n_solved": 0, "roc_auc": np.nan}
    along = None
    if record["outcome"] == outcome.OK:
        estimate = store.estimate(job.id)
        rotations = estimate.rotations
        scores["n_solved"] = int(np.isfinite(rotations).all(axis=(1, 2)).sum())
        scores |= edge_metrics(instance.problem, rotations, instance.truth)
        if estimate.edge_weights is not None and instance.outliers is not None:
            scores["roc_auc"] = roc_auc(estimate.edge_weights, instance.outliers)
        if instance.truth is not None:
            errors = camera_errors(rotations, instance.truth, rule)
            along = curve(estimate, instance.truth, rule) if checkpoints else None
    if instance.truth is not None:
        collected.errors.setdefault(place, {}).setdefault(method, []).append(errors)
    collected.rows.append(
        {
            "dataset": dataset,
            "instance": job.instance,
            "method": job.method,
            "title": job.title,
            "params": method[1],
            "seed": job.seed,
            "protocol": instance.protocol,
            "alignment": rule,
            "status": record["status"],
            **summary(errors),
            "solve_s": record.get("solve_s"),
            "peak_mib": record.get("peak_mib"),
            "conversion_s": record.get("conversion_s"),
            "n_cameras": instance.problem.n,
            "n_edges": instance.problem.m,
            **scores,
            **{name: instance.statistics.get(name) for name in ("edges_percent", "hardness")},
            **{name: record.get(name) for name in ("iterations", "stop_reason", "cost", "certificate")},
            "notes": "; ".join(record.get("notes", ())),
            "job": job.id,
            **_times(job, record),
        }
    )
    if along is not None:
        collected.curves.setdefault(place, {}).setdefault(method, []).append(along)
        if oracle:
            collected.rows.append(_oracle_row(collected.rows[-1], along))


def _times(job: Job, record: Mapping[str, Any]) -> dict[str, Any]:
    """What only the rows of a timing run have."""
    if job.rounds == 0:
        return {}
    rounds = {"timing": True, "rounds": job.rounds, "round_s": record.get("round_s", ())}
    return rounds | {name: record.get(name) for name in ("min_s", "waited")}


def _compare_times(rows: list[dict[str, Any]], baseline: str) -> None:
    """Add to every row how many times faster than the baseline on the same problem it was."""

    def place(row: Mapping[str, Any]) -> Place:
        return row["dataset"], row["instance"], row["protocol"]

    named = [row for row in rows if f"{row['method']}[{row['params']}]".removesuffix("[]") == baseline]
    of_seed = {(place(row), row["seed"]): row["round_s"] for row in named}
    of_any = {place(row): row["round_s"] for row in reversed(named)}  # a deterministic baseline has one seed
    for row in rows:
        own, base = row["round_s"], of_seed.get((place(row), row["seed"]), of_any.get(place(row), ()))
        both = speedup(base, own) if own and len(own) == len(base) else (None, None, None)
        row |= dict(zip(("speedup", "speedup_low", "speedup_high"), both, strict=True)) | {"baseline": baseline}


def _oracle_row(row: Mapping[str, Any], along: Curve) -> dict[str, Any]:
    """The row of an estimate's best checkpoint; what only its end has is left out."""
    pick = along.oracle
    count = len(along.iterations)
    absent = dict.fromkeys(
        (
            *("peak_mib", "cost", "certificate", "roc_auc", "min_s"),
            *(k for k in row if k.startswith(("residual", "cost_"))),
        )
    )
    return {
        **row,
        **absent,
        **({"round_s": ()} if "round_s" in row else {}),
        **summary(along.errors[pick]),
        "params": ",".join(filter(None, [row["params"], ORACLE])),
        "solve_s": along.seconds[pick],
        "iterations": int(along.iterations[pick]),
        "stop_reason": ORACLE,
        "notes": f"{ORACLE}: checkpoint {pick + 1} of {count}, picked by the smallest error against ground truth",
    }


def tied(by_method: Mapping[Configured, list[Floats]], same_cameras: bool) -> set[Configured]:
    """Ties; on one instance a deterministic method ran once, and would have done the same under every seed."""
    seeds = max(map(len, by_method.values()))
    repeated = {m: errors * (seeds if same_cameras and len(errors) == 1 else 1) for m, errors in by_method.items()}
    return tie_groups({m: _stacked(errors) for m, errors in repeated.items()}, same_cameras=same_cameras)


def _stacked(errors: list[Floats]) -> Floats:
    """(seeds, cameras), padded with NaN where the instances of the seeds differ in size."""
    out = np.full((len(errors), max(len(e) for e in errors)), np.nan)
    for row, e in zip(out, errors, strict=True):
        row[: len(e)] = e
    return out
