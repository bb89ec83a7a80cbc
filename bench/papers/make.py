"""Make an item of a paper again: run what is not done, score it, compare."""

from collections.abc import Callable, Sequence

from bench.papers.computed import Computed, scores_of
from bench.papers.item import Comparison, Item
from bench.papers.layout import Layout
from bench.plugins.selection import label
from bench.running.run import NothingToRunError, Options, Run
from bench.scoring.results import score
from bench.suite.experiment import Suite

Runner = Callable[[Run], None]


def make(layout: Layout, item: Item, options: Options, alignment: str | None, run: Runner) -> Comparison:
    """Run what is not done, then compare.

    Parameters
    ----------
    layout, item
        The paper, and which of its items.
    options
        Of the run.
    alignment
        In place of the item's own.
    run
        Prepares and executes a planned run.
    """
    runs, missing = run_all(item.suites(layout.name), options, run)
    return item.compare(layout.sources, _computed(item, alignment or item.alignment, runs, missing))


def run_all(suites: Sequence[Suite], options: Options, run: Runner) -> tuple[list[Run], list[str]]:
    """Run what is not done of several suites; the runs, and a sentence for what is not on disk."""
    missing: list[str] = []
    runs = []
    for suite in suites:
        try:
            planned = Run(suite, options=options)
        except NothingToRunError as nothing:
            missing += nothing.missing
            continue
        run(planned)
        missing += planned.experiment.missing
        runs.append(planned)
    return runs, missing


def _computed(item: Item, rule: str, runs: Sequence[Run], missing: Sequence[str]) -> Computed:
    if not runs:
        return Computed(rule, missing=missing)
    store = runs[0].store
    jobs = [cell.job for planned in runs for cell in planned.cells]
    notes = {job.instance: store.instance(key).notes for key, job in {job.instance_key: job for job in jobs}.items()}
    once = list({job.id: job for job in jobs}.values())
    found = score(store, rule, jobs=once, oracle="oracle" in item.needs, checkpoints="checkpoints" in item.needs)
    curves = {label(*key): along for by_method in found.curves.values() for key, along in by_method.items()}
    scores = tuple(scores_of(found, jobs))
    return Computed(rule, jobs, scores, curves, notes, missing, lambda job: store.instance(job.instance_key))
