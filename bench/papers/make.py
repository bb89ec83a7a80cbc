"""Make an item of a paper again: run what is not done, score it, compare."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from bench.core.errors import InputError
from bench.papers.computed import Computed, scores_of
from bench.papers.item import Comparison, Item
from bench.papers.layout import Layout
from bench.plugins.catalog import catalog, plugin_path
from bench.plugins.selection import format_selection, label
from bench.running.run import NothingToRunError, Options, Run
from bench.scoring.results import score
from bench.suite.experiment import Suite

Runner = Callable[[Run], None]


@dataclass(frozen=True)
class Planned:
    """Runs that have been planned in one folder, and a sentence for what is not on disk."""

    runs: tuple[Run, ...]
    missing: tuple[str, ...]

    @property
    def jobs(self) -> int:
        """How many there are, each counted once."""
        return len({cell.job.id for run in self.runs for cell in run.cells})

    @property
    def todo(self) -> int:
        """How many of them are not done."""
        return sum(len(run.todo) for run in self.runs)

    def execute(self, run: Runner) -> "Planned":
        """Have what is not done run; what could not be loaded is missing too then."""
        for planned in self.runs:
            run(planned)
        return Planned(self.runs, (*self.missing, *(one for planned in self.runs for one in planned.unloaded)))


def plan(suites: Iterable[Suite], options: Options, taken: set[str] | None = None) -> Planned:
    """Plan all suites, so that whatever is wrong with one of them is said before any job of another has run.

    Parameters
    ----------
    suites, options
        What runs, and how.
    taken
        Ids of the jobs that other plans for the same folder run; those of this one are added.

    Raises
    ------
    InputError
        On an unknown method or dataset, and whatever else `bench.running.run.Run` refuses.
    """
    missing: list[str] = []
    runs: list[Run] = []
    taken = set() if taken is None else taken
    for suite in suites:
        try:
            planned = Run(suite, suite.methods, options=options)
        except NothingToRunError as nothing:
            missing += nothing.missing
            continue
        planned.todo = [cell for cell in planned.todo if cell.job.id not in taken]
        taken |= {cell.job.id for cell in planned.todo}
        missing += planned.experiment.missing
        runs.append(planned)
    return Planned(tuple(runs), tuple(missing))


def with_methods(item: Item, methods: Sequence[str], options: Options) -> Item:
    """The item with further methods: those that are named, or else all that the plug-in files declare.

    Raises
    ------
    InputError
        On a method that there is not, and where the item has no place for them.
    """
    if not methods and not options.plugins:
        return item
    known = catalog("method", options.plugins)
    own = {plugin_path(path) for path in options.plugins}
    named = methods or [info.name for info in known if info.origin in own]
    for origin in own & set(known.broken):
        raise InputError(f"a plug-in is broken: {known.broken[origin]}")
    return item.with_methods([format_selection(info.name, given) for info, given in known.select(named)])


def compared(layout: Layout, item: Item, alignment: str | None, planned: Planned, options: Options) -> Comparison:
    """What was computed beside what is published.

    Parameters
    ----------
    layout, item
        The paper, and which of its items.
    alignment
        In place of the item's own.
    planned
        What has run.
    options
        Of the run.
    """
    return item.compare(layout.sources, _computed(item, alignment or item.alignment, planned, options))


def _computed(item: Item, rule: str, planned: Planned, options: Options) -> Computed:
    if not planned.runs:
        return Computed(rule, missing=planned.missing, plugins=options.plugins)
    store = planned.runs[0].store
    jobs = [cell.job for run in planned.runs for cell in run.cells]
    notes = {job.instance: store.instance(key).notes for key, job in {job.instance_key: job for job in jobs}.items()}
    once = list({job.id: job for job in jobs}.values())
    found = score(store, rule, jobs=once, oracle="oracle" in item.needs, checkpoints="checkpoints" in item.needs)
    curves = {label(*key): along for by_method in found.curves.values() for key, along in by_method.items()}
    scores = tuple(scores_of(found, jobs))
    return Computed(
        rule,
        jobs,
        scores,
        curves,
        notes,
        planned.missing,
        lambda job: store.instance(job.instance_key),
        options.plugins,
    )
