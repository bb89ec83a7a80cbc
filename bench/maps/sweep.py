"""A phase map in the making: samples are ordinary jobs of an ordinary run, asked for round by round."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.core.errors import InputError
from bench.core.problem import Floats
from bench.maps.adaptive import Bools, Counts, Sample, Tally, every_sample, next_samples
from bench.maps.axes import Axis
from bench.maps.bounds import Drawn
from bench.maps.criterion import Criterion, median_of_all
from bench.plugins import selection
from bench.plugins.catalog import catalog
from bench.running.run import Options, Run
from bench.scoring.metrics.errors import camera_errors
from bench.suite.experiment import Cell, Suite

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Sweep:
    """What a map is of.

    Parameters
    ----------
    methods, dataset
        Selections; the dataset's is one configuration, without the parameters of the axes.
    x, y
        The two parameters that are varied.
    seeds
        Samples of a cell, at most; its outcome is that of more than half of them, so odd numbers are best.
    success, alignment
        What counts as success, and the rule that removes the gauge.
    """

    methods: tuple[str, ...]
    dataset: str
    x: Axis
    y: Axis
    seeds: int
    success: Criterion
    alignment: str = "l1"

    @property
    def shape(self) -> tuple[int, int]:
        """Cells along x and along y."""
        return len(self.x.values), len(self.y.values)

    def varied(self, x: int, y: int) -> dict[str, Any]:
        """The two parameters in a cell."""
        return {self.x.parameter: self.x.values[x], self.y.parameter: self.y.values[y]}


@dataclass(frozen=True, eq=False)
class Layers:
    """What a map knows of one method, all (nx, ny).

    Parameters
    ----------
    samples, successes, failed
        How many samples were taken, succeeded, and had no answer.
    median_deg
        Mean over the samples that have an answer; NaN where none has.
    success
        Whether more than half of the samples succeed, or in a cell without any, whether the nearest sampled cell does.
    """

    samples: Counts
    successes: Counts
    failed: Counts
    median_deg: Floats
    success: Bools


class PhaseMap:
    """The samples taken so far, and what to take next.

    Parameters
    ----------
    sweep
        What the map is of.
    options
        Of the run; `seeds` and the suite's selections come from the sweep.

    Raises
    ------
    InputError
        On anything that the user has to change; nothing is written then.
    """

    def __init__(self, sweep: Sweep, options: Options) -> None:
        self.sweep = sweep
        self.dataset, given = catalog("dataset", options.plugins).one(sweep.dataset)
        for axis in (sweep.x, sweep.y):
            if axis.parameter in given:
                raise InputError(f"'{axis.parameter}' is an axis of the map; leave it out of '{sweep.dataset}'")
        if sweep.x.parameter == sweep.y.parameter:
            raise InputError(f"both axes are '{sweep.x.parameter}'; a map needs two parameters")
        self.parameters = {**self.dataset.defaults(), **given}
        sweep.success.check(self.parameters)
        places = {
            selection.format_selection(self.dataset.name, given | sweep.varied(x, y)): (x, y)
            for x, y in np.ndindex(*sweep.shape)
        }
        title = f"{sweep.x.parameter} x {sweep.y.parameter}"
        suite = Suite("map", title, tuple(places), sweep.methods, sweep.seeds)
        self.run = Run(suite, options=replace(options, seeds=None))
        self._instance = lru_cache(1)(self.run.store.instance)  # the methods of a batch come one after another on it
        self._cells = self._indexed(places)
        self.methods = tuple(dict.fromkeys(method for method, _ in self._cells))
        self.tallies = {method: Tally.empty(sweep.shape, sweep.seeds) for method in self.methods}
        self._medians_deg: dict[tuple[str, int, int], list[float]] = {}  # by method and place, of what was answered

    @property
    def taken(self) -> int:
        """Samples that the map stands on."""
        return int(sum(tally.tried.sum() for tally in self.tallies.values()))

    @property
    def grid(self) -> int:
        """Samples of the full grid."""
        return len(self._cells)

    def explore(
        self,
        execute: Callable[[Run], None],
        *,
        full: bool = False,
        budget: int | None = None,
        tell: Callable[[str], None] = lambda _: None,
    ) -> bool:
        """Sample until the boundary of every method is known.

        Parameters
        ----------
        execute
            Runs what a run has to do.
        full
            Take every sample of the grid instead.
        budget
            Take no more samples than that, those of earlier calls on the same folder among them.
        tell
            Is told what each round is.

        Returns
        -------
        Whether the map is complete; False where the budget ended before.
        """
        wanted = every_sample if full else next_samples
        number = 0
        while batch := [(method, s) for method, tally in self.tallies.items() for s in wanted(tally)]:
            left = len(batch) if budget is None else budget - self.taken
            batch = sorted(batch, key=lambda entry: entry[1])[: max(left, 0)]
            if not batch:
                return False
            number += 1
            part = self.run.only({self._cells[entry].job.id for entry in batch})
            stored = len(batch) - len(part.todo)
            tell(f"round {number}: {len(batch)} samples{f', {stored} of them stored' if stored else ''}")
            if part.todo:
                part.prepare()
                if part.unloaded:  # a sample that was never a problem is no failure of the method
                    raise InputError("; ".join(part.unloaded))
                execute(part)
            for method, sample in batch:
                self._count(method, sample)
        return True

    def layers(self) -> dict[str, Layers]:
        """The map of each method."""
        return {method: self._layers(method, tally) for method, tally in self.tallies.items()}

    def _layers(self, method: str, tally: Tally) -> Layers:
        answered, medians_deg = np.zeros(self.sweep.shape, np.intp), np.full(self.sweep.shape, np.nan)
        for (of, *place), medians in self._medians_deg.items():
            if of == method:
                answered[*place], medians_deg[*place] = len(medians), np.mean(medians)
        return Layers(tally.tried, tally.hits, tally.tried - answered, medians_deg, tally.expected())

    def frame(self) -> "pd.DataFrame":
        """The map, one row for each method and cell: the two parameters, then the fields of `Layers`."""
        import pandas as pd

        x, y = self.sweep.x, self.sweep.y
        return pd.DataFrame(
            [
                {"method": method, x.parameter: x.values[i], y.parameter: y.values[j]}
                | {name: values[i, j] for name, values in vars(own).items()}
                for method, own in self.layers().items()
                for i, j in np.ndindex(*self.sweep.shape)
            ]
        )

    def problems(self) -> Iterator[Drawn]:
        """Every cell's place, complete parameters and instances, made anew: most are never solved."""
        first = self.methods[0]
        for x, y in np.ndindex(*self.sweep.shape):
            sources = [self._cells[first, (x, y, seed)].source for seed in range(self.sweep.seeds)]
            yield (x, y), self.parameters | self.sweep.varied(x, y), (source.load() for source in sources)

    def _indexed(self, places: Mapping[str, tuple[int, int]]) -> dict[tuple[str, Sample], Cell]:
        """Every cell of the experiment by method and sample; `places` are those of the dataset's selections."""
        found = {}
        for cell in self.run.cells:
            job = cell.job
            if cell.method.not_installed(job.parameters):
                hint = cell.method.install_hint(job.parameters)
                raise InputError(f"method '{job.label}' is not installed: {hint}")
            found[job.label, (*places[job.dataset], job.seed)] = cell
        methods = {method for method, _ in found}
        if len(found) != len(methods) * len(places) * self.sweep.seeds:
            raise InputError(f"dataset '{self.dataset.name}' is not drawn anew for every seed; a map needs one that is")
        return found

    def _count(self, method: str, sample: Sample) -> None:
        cell = self._cells[method, sample]
        store = self.run.store
        record = store.record(cell.job.id)
        success = False
        if record is not None and record.outcome.ok:
            instance = self._instance(cell.job.instance_key)
            if instance.truth is None:
                raise InputError(f"dataset '{self.dataset.name}' has no truth to tell success by")
            errors = camera_errors(store.estimate(cell.job.id).rotations, instance.truth, self.sweep.alignment)
            median = median_of_all(errors[np.isfinite(instance.truth).all(axis=(1, 2))])
            success = self.sweep.success.met(median, instance, self.parameters | self.sweep.varied(*sample[:2]))
            self._medians_deg.setdefault((method, *sample[:2]), []).append(median)
        self.tallies[method].add(sample, success)
