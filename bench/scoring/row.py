"""The row of one job: what was measured, and how good its estimate is."""

from typing import Any

import numpy as np

from bench.core import outcome
from bench.core.outcome import Outcome
from bench.core.problem import Estimate, Floats, Instance
from bench.scoring.metrics.errors import edge_metrics, summary
from bench.scoring.metrics.roc import roc_auc
from bench.storage.record import Record, Report

OF_INSTANCE = ("edges_percent", "hardness")


def scored(instance: Instance, record: Record | None, estimate: Estimate | None, errors: Floats) -> dict[str, Any]:
    """Everything that a table knows of a job, as long as its record stays as it is.

    Parameters
    ----------
    instance, record
        Of the job; None where it has not been run.
    estimate
        None unless the outcome is ``ok``.
    errors
        (n,) of its cameras, in degrees; none where there is no truth.
    """
    problem, truth = instance.problem, instance.truth
    scores: dict[str, Any] = {"n_solved": 0, "roc_auc": np.nan}
    if estimate is not None:
        rotations = estimate.rotations
        scores["n_solved"] = int(np.isfinite(rotations).all(axis=(1, 2)).sum())
        scores |= edge_metrics(problem, rotations, truth)
        if estimate.edge_weights is not None and instance.outliers is not None:
            scores["roc_auc"] = roc_auc(estimate.edge_weights, instance.outliers)
    ended = record.outcome if record else Outcome(outcome.NOT_RUN)
    report, round_s = (record.report, record.round_s) if record else (Report(), ())
    return {
        "protocol": instance.protocol,
        "collection": instance.collection,
        "outcome": ended.kind,
        "status": ended.text,
        **summary(errors),
        "solve_s": report.solve_s,
        "peak_mib": report.peak_mib,
        "conversion_s": report.conversion_s,
        "n_cameras": problem.n,
        "n_edges": problem.m,
        **scores,
        **{name: instance.statistics.get(name) for name in OF_INSTANCE},
        "iterations": report.iterations,
        "stop_reason": report.stop_reason,
        "cost": report.cost,
        "certificate": report.certificate,
        "used": " ".join(report.used),
        "offered": " ".join(sorted(problem.carries)),
        "notes": "; ".join(report.notes),
        "round_s": round_s,
        "min_s": min(round_s, default=None),
        "waited": report.waited,
        "has_truth": truth is not None,
        "n_checkpoints": len(report.checkpoints) if estimate is not None else 0,
        "instance_notes": list(instance.notes),
        "errors": errors,
    }
