"""The same run under other alignment rules; residuals, costs, times and failures do not depend on the rule."""

from dataclasses import replace

import numpy as np
import pandas as pd

from bench.problem import Floats
from bench.reporting.rows import OK
from bench.results import Configured, Place, Results, tied
from bench.scoring.alignment import RULES
from bench.scoring.errors import camera_errors, summary
from bench.store import Store


def under_every_rule(store: Store, results: Results) -> dict[str, Results]:
    """By alignment rule, that of `results` first; nothing is run."""
    others = [rule for rule in RULES if rule != results.alignment]
    return {results.alignment: results} | {rule: realigned(store, results, rule) for rule in others}


def realigned(store: Store, results: Results, rule: str) -> Results:
    """Results with errors and ties under another rule, and without curves."""
    key_of = {job.id: job.instance_key for job in store.jobs()}
    truths: dict[str, Floats | None] = {}
    errors: dict[Place, dict[Configured, list[Floats]]] = {}
    instances: dict[Place, set[str]] = {}
    summaries = []
    frame = results.frame
    columns = (frame[name] for name in ("dataset", "instance", "protocol", "method", "params", "status", "job"))
    for dataset, instance, protocol, method, params, status, job in zip(*columns, strict=True):
        key = key_of[job]
        if key not in truths:
            truths[key] = store.instance(key).truth
        truth, place = truths[key], (str(dataset), str(instance), str(protocol))
        if truth is None:
            summaries.append(summary(np.empty(0)))
            continue
        of_job = np.full(len(truth), np.nan)
        if status == OK:
            of_job = camera_errors(store.estimate(job).rotations, truth, rule)
        summaries.append(summary(of_job))
        errors.setdefault(place, {}).setdefault((str(method), str(params)), []).append(of_job)
        instances.setdefault(place, set()).add(key)
    scored = pd.DataFrame(summaries, index=frame.index)
    return replace(
        results,
        frame=frame.assign(alignment=rule, **{name: scored[name] for name in scored}),
        errors={place: {m: tuple(e) for m, e in by_method.items()} for place, by_method in errors.items()},
        ties={place: tied(e, same_cameras=len(instances[place]) == 1) for place, e in errors.items()},
        alignment=rule,
        curves={},
    )
