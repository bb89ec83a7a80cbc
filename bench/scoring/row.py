"""The row of one job: what was measured, and how good its estimate is."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from bench.core import outcome
from bench.core.problem import Estimate, Floats, Instance
from bench.scoring.metrics.errors import edge_metrics, summary
from bench.scoring.metrics.roc import roc_auc

MEASURED = ("solve_s", "peak_mib", "conversion_s")
REPORTED = ("iterations", "stop_reason", "cost", "certificate")
OF_INSTANCE = ("edges_percent", "hardness")
NOT_RUN = {"outcome": outcome.NOT_RUN, "status": outcome.NOT_RUN}


def scored(instance: Instance, record: Mapping[str, Any], estimate: Estimate | None, errors: Floats) -> dict[str, Any]:
    """Everything that a table knows of a job, as long as its record stays as it is.

    Parameters
    ----------
    instance, record
        Of the job; `NOT_RUN` where there is no record.
    estimate
        None unless the outcome is ``ok``.
    errors
        Of its cameras, in degrees; none where there is no truth.
    """
    problem, truth = instance.problem, instance.truth
    scores: dict[str, Any] = {"n_solved": 0, "roc_auc": np.nan}
    if estimate is not None:
        rotations = estimate.rotations
        scores["n_solved"] = int(np.isfinite(rotations).all(axis=(1, 2)).sum())
        scores |= edge_metrics(problem, rotations, truth)
        if estimate.edge_weights is not None and instance.outliers is not None:
            scores["roc_auc"] = roc_auc(estimate.edge_weights, instance.outliers)
    return {
        "protocol": instance.protocol,
        "outcome": record["outcome"],
        "status": record["status"],
        **summary(errors),
        **{name: record.get(name) for name in MEASURED},
        "n_cameras": problem.n,
        "n_edges": problem.m,
        **scores,
        **{name: instance.statistics.get(name) for name in OF_INSTANCE},
        **{name: record.get(name) for name in REPORTED},
        "notes": "; ".join(record.get("notes", ())),
        "round_s": record.get("round_s", ()),
        "min_s": record.get("min_s"),
        "waited": record.get("waited"),
        "has_truth": truth is not None,
        "n_checkpoints": len(record.get("checkpoints", ())) if estimate is not None else 0,
        "instance_notes": list(instance.notes),
        "errors": errors,
    }
