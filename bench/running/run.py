"""Run an experiment into a store: plan, prepare the instances, run what is not done."""

import contextlib
import copy
import os
import shlex
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bench.core import outcome
from bench.core.errors import InputError
from bench.core.limits import Limits
from bench.core.problem import Information
from bench.core.program import program
from bench.learning.override import with_weights
from bench.plugins.catalog import catalog
from bench.running.engines.local import Finished, LocalEngine
from bench.running.engines.timing import TimingEngine
from bench.storage.store import Store
from bench.suite import experiment
from bench.suite.experiment import Cell, Experiment, Suite
from bench.suite.plan import Plan

if TYPE_CHECKING:
    from bench.running.engines.dask import DaskEngine

Rerun = Literal["never", "failed", "always"]
Engine = Literal["local", "dask"]
RUNS_FOLDER = Path("results", "runs")


@dataclass(frozen=True)
class Options:
    """What `run` takes besides the suite; None means as the suite says.

    Parameters
    ----------
    out
        Folder of the run; by default ``results/runs/<suite>``, for timing runs ``results/runs/<suite>-timing``.
    data_dir
        Where data are looked for first.
    seeds, timeout_s, memory_gib
        Override the suite's.
    jobs, threads
        How many jobs at a time, and how many threads the numerical libraries of each may use (by default one).
    truth
        A file or folder with absolute rotations, where a dataset is named by the path of a graph.
    use
        What methods may use of what comes with the measurements; None for all that they can.
    weights
        File of other weights for the method that was trained to them.
    protocol
        Override the protocol of every dataset that has one.
    rerun
        Which jobs with a record are run again. "never" still repeats those that ended at a lower limit than
        today's, and those whose package was not installed.
    timing
        Time the jobs one after another on one core, in rounds; see `bench.running.engines.timing`.
    rounds
        Override the suite's.
    engine
        "local" for child processes of this one, "dask" for the workers of a dask cluster, which must see the run's
        folder and the plug-in files under the same paths.
    scheduler
        Address of a running dask scheduler; without one the dask engine starts a cluster of its own on this machine,
        with `jobs` worker processes.
    plugins
        Files with more methods and datasets; when no methods are named, their methods join the suite's.
    """

    out: Path | None = None
    data_dir: Path | None = None
    seeds: int | None = None
    jobs: int | None = None
    threads: int | None = None
    timeout_s: float | None = None
    memory_gib: float | None = None
    truth: str = ""
    use: tuple[Information, ...] | None = None
    weights: Path | None = None
    protocol: str | None = None
    rerun: Rerun = "never"
    timing: bool = False
    rounds: int | None = None
    engine: Engine = "local"
    scheduler: str | None = None
    plugins: tuple[Path, ...] = ()


class NothingToRunError(InputError):
    """No instance is on disk; `missing` holds a sentence for each that was asked for."""

    def __init__(self, missing: Sequence[str]) -> None:
        super().__init__("there is nothing to run: " + "; ".join(missing))
        self.missing = tuple(missing)


class Run:
    """A run that has been planned: what there is to do, and how to do it.

    Raises
    ------
    InputError
        On anything that the user has to change; nothing is written then.
    """

    def __init__(
        self,
        suite: str | Suite | None,
        methods: Sequence[str] = (),
        datasets: Sequence[str] = (),
        options: Options | None = None,
    ) -> None:
        self.options = options = options or Options()
        _check_engine(options)
        self.experiment = _resolved(suite, methods, datasets, options)
        if not self.experiment.cells:
            raise NothingToRunError(self.experiment.missing)
        suffix = "-timing" if options.timing else ""
        folder = options.out or RUNS_FOLDER / f"{self.experiment.suite.name}{suffix}"
        self.store = Store.open(folder) if (folder / "plans").is_dir() else Store(folder)
        _check_kind(self.store, options.timing)
        self.unloaded: tuple[str, ...] = ()  # a sentence for each instance that `prepare` could not load
        self.unreadable: list[str] = []  # a sentence for each record whose job is run again because of that
        chosen = self.experiment.suite
        self.limits = Limits(chosen.timeout_s, chosen.memory_gib, options.threads or 1)
        self.todo = [cell for cell in self.cells if not self._done(cell)]
        if options.timing:  # methods can be compared only where they took turns
            affected = {cell.job.instance_key for cell in self.todo}
            self.todo = [cell for cell in self.cells if cell.job.instance_key in affected]

    @property
    def cells(self) -> tuple[Cell, ...]:
        """Every cell of the experiment."""
        return self.experiment.cells

    @property
    def baseline(self) -> str:
        """The suite's baseline as it is in tables, or the first method where that was not chosen."""
        planned = [cell.job.label for cell in self.cells]
        return self.experiment.suite.baseline if self.experiment.suite.baseline in planned else planned[0]

    def only(self, jobs: Collection[str]) -> "Run":
        """The same run with the cells of these job ids alone; to do is what was to do when this run was planned."""
        part = copy.copy(self)
        part.experiment = replace(self.experiment, cells=tuple(cell for cell in self.cells if cell.job.id in jobs))
        part.todo = [cell for cell in self.todo if cell.job.id in jobs]
        return part

    def _done(self, cell: Cell) -> bool:
        if self.options.rerun == "always":
            return False
        try:
            record = self.store.record(cell.job.id)
        except InputError as error:
            self.unreadable.append(str(error))
            return False
        ended = record.outcome.kind if record else outcome.NOT_RUN
        if record is None or ended == outcome.NOT_INSTALLED:
            return False
        if self.options.rerun == "failed":
            return ended in (outcome.OK, outcome.SKIPPED)
        if ended == outcome.TIMEOUT:
            return record.limits.seconds >= self.limits.seconds
        return ended != outcome.OUT_OF_MEMORY or record.limits.memory_gib >= self.limits.memory_gib

    def prepare(self, tell: Callable[[str], None] = lambda _: None) -> None:
        """Load the instances that are not stored yet, then keep the plan.

        An instance that cannot be loaded costs its own cells: they leave the experiment, which names it as missing.

        Raises
        ------
        InputError
            Where none can be loaded, or the disk takes none; no plan is kept then.
        """
        self.store.sweep()
        for sentence in self.unreadable:
            tell(sentence.replace("run the same command again", "its job is run again"))
        needed = {cell.job.instance_key for cell in self.todo}
        lost: dict[str, str] = {}
        for key, cell in {cell.job.instance_key: cell for cell in self.cells}.items():
            if not (self.store.has_instance(key) if key in needed else self.store.problem_path(key).exists()):
                name = f"{cell.job.dataset} {cell.job.instance}"
                tell(f"loading {name}")
                try:
                    instance = cell.source.load()
                except InputError as error:
                    lost[key] = f"{name} cannot be loaded and is left out: {error}"
                    tell(lost[key])
                else:
                    self.store.add_instance(key, instance)
        self._leave_out(lost)
        command = f"{program()} {shlex.join(sys.argv[1:])}"
        jobs = tuple(cell.job for cell in self.cells)
        baseline = self.baseline if self.options.timing else ""
        self.store.add_plan(Plan(self.experiment.suite.name, jobs, self.experiment.missing, command, baseline))

    def _leave_out(self, lost: Mapping[str, str]) -> None:
        """Go on without the instances of these keys, each with a sentence that says why."""
        kept = [cell for cell in self.cells if cell.job.instance_key not in lost]
        if lost and not kept:
            raise InputError("; ".join(lost.values()))
        self.unloaded = tuple(lost.values())
        missing = (*self.experiment.missing, *self.unloaded)
        self.experiment = replace(self.experiment, cells=tuple(kept), missing=missing)
        self.todo = [cell for cell in self.todo if cell.job.instance_key not in lost]

    def execute(self) -> Iterator[Finished]:
        """Run what is not done; yield each cell with its record as it is stored."""
        with contextlib.closing(self._engine().run(self.todo)) as finished:
            yield from finished

    def _engine(self) -> "LocalEngine | TimingEngine | DaskEngine":
        workers = self.options.jobs or os.cpu_count() or 1
        if self.options.timing:
            return TimingEngine(self.store, self.limits)
        if self.options.engine == "dask":
            from bench.running.engines.dask import DaskEngine

            return DaskEngine(self.store, self.limits, workers, self.options.scheduler)
        return LocalEngine(self.store, self.limits, workers)


def _resolved(
    named: str | Suite | None, methods: Sequence[str], datasets: Sequence[str], options: Options
) -> Experiment:
    if options.data_dir is not None and not options.data_dir.is_dir():
        raise InputError(f"--data-dir {options.data_dir}: there is no such folder")
    suite = named if isinstance(named, Suite) else experiment.load_suite(named or experiment.DEFAULT_SUITE)
    known_methods = catalog("method", options.plugins)
    known_datasets = catalog("dataset", options.plugins)
    own = [str(Path(path).resolve()) for path in options.plugins]
    for origin in own:
        if origin in known_methods.broken:
            raise InputError(f"a plug-in is broken: {known_methods.broken[origin]}")
    plugged_in = [info.name for info in known_methods if info.origin in own]
    changes: dict[str, Any] = {
        "methods": with_weights(tuple(methods) or (*suite.methods, *plugged_in), options.weights),
        "seeds": options.seeds,
        "rounds": options.rounds,
        "timeout_s": options.timeout_s,
        "memory_gib": options.memory_gib,
    }
    if datasets:
        meant = [known_datasets.with_paths(text, options.truth) for text in datasets]
        changes["datasets"] = experiment.narrowed(suite.datasets, meant)
    elif options.truth:
        raise InputError("--truth is that of a file or folder named with --dataset; name one")
    if methods and datasets and named is None:
        changes["name"] = "custom"
    suite = replace(suite, **{key: value for key, value in changes.items() if value is not None})
    if options.threads is not None and options.threads < 1:
        raise InputError(f"threads must be above zero, not {options.threads}")
    return experiment.resolve(
        suite,
        known_methods,
        known_datasets,
        data_dir=options.data_dir,
        protocol=options.protocol,
        timing=options.timing,
        use=options.use,
    )


def _check_engine(options: Options) -> None:
    if options.engine == "dask":
        if options.timing:
            raise InputError("--timing measures on this machine, one job at a time; leave out --engine dask")
        try:
            import distributed  # noqa: F401
        except ImportError as error:
            hint = "python -m pip install 'rotsync-bench[dask]'"
            raise InputError(f"--engine dask needs the package distributed; get it with: {hint}") from error
    elif options.scheduler is not None:
        raise InputError("--scheduler is the address of a dask scheduler; add --engine dask")


def _check_kind(store: Store, timing: bool) -> None:
    """Times of packed jobs and of timing runs are not kept in one folder."""
    if {plan.timing for plan in store.plans()} - {timing}:
        holds, wants = ("an ordinary", "a timing") if timing else ("a timing", "an ordinary")
        raise InputError(f"{store.folder} holds {holds} run; give {wants} run a folder of its own with --out")
