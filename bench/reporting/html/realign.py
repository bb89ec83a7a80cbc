"""The same run under other alignment rules."""

from bench.scoring.metrics.alignment import RULES
from bench.scoring.results import Results, score
from bench.storage.store import Store


def under_every_rule(store: Store, results: Results) -> dict[str, Results]:
    """By alignment rule, that of `results` first; nothing is run, and no curves are scored."""
    shown = set(results.frame["job"])
    jobs = [job for job in store.jobs() if job.id in shown]
    others = [rule for rule in RULES if rule != results.alignment]
    return {results.alignment: results} | {rule: score(store, rule, jobs=jobs) for rule in others}
