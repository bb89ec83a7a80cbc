"""Candidates on simulated twins of a graph, within a budget of time."""

import tempfile
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bench.advice.look import Look, look
from bench.core.errors import InputError
from bench.core.outcome import NOT_RUN, OK
from bench.core.problem import Instance
from bench.core.words import counted
from bench.plugins.catalog import catalog
from bench.plugins.declare import Missing, Source
from bench.plugins.selection import format_selection, label, parse
from bench.plugins.sources import sources_of
from bench.running.run import Options, Run
from bench.scoring.calibration.agreement import FACTOR
from bench.scoring.results import Configured, Results, score
from bench.storage.store import Store
from bench.suite.experiment import Suite, load_suite
from bench.suite.plan import Job

if TYPE_CHECKING:
    import pandas as pd

SUITE = "recommend"
LEAST_DEG = 1e-3  # closures below it count as it
_SHARE = 0.25  # of the budget, that one job may take


@dataclass(frozen=True)
class Trial:
    """What became of the candidates.

    Parameters
    ----------
    results
        Scores on the twins that all of them were run on.
    twins
        How many these are.
    closures_deg
        Quantiles of how far triangles of the twins are from closing, medians over the twins; those of
        `bench.advice.look.Look`.
    left_out
        A sentence for each candidate that did not take part.
    seconds
        What it took.
    """

    results: Results
    twins: int
    closures_deg: tuple[float, ...]
    left_out: tuple[str, ...]
    seconds: float

    @property
    def able(self) -> set[Configured]:
        """Configured methods that ended well on every twin."""
        groups = self.results.frame.groupby(["method", "params"])["outcome"]
        return {(str(method), str(params)) for (method, params), ended in groups if (ended == OK).all()}

    def misfit(self, seen: Look) -> float:
        """The largest factor between closures of the graph and of its twins; infinite where one has none."""
        if not (seen.closures_deg and self.closures_deg):
            return float("inf")
        of_graph, of_twins = (np.log(np.maximum(one, LEAST_DEG)) for one in (seen.closures_deg, self.closures_deg))
        return float(np.exp(np.abs(of_graph - of_twins).max()))

    def fits(self, seen: Look) -> bool:
        """Whether the twins' triangles close like those of the graph, within the bound that calibration asks for."""
        return self.misfit(seen) <= FACTOR


def load(graph: str, data_dir: Path | None = None, plugins: Sequence[Path] = ()) -> Instance:
    """The graph that a path or a selection of a dataset stands for.

    Raises
    ------
    InputError
        Where it stands for none, for several, or for one that is not on disk.
    """
    known = catalog("dataset", plugins)
    found: list[tuple[str, Source | Missing]] = [
        (info.name, source)
        for info, parameters in known.select([known.with_paths(graph)])
        for source in sources_of(info, info.configure(parameters), data_dir, 0)
    ]
    if len(found) != 1:
        raise InputError(f"{graph} stands for {counted(len(found), 'graph')}: name one")
    [(name, source)] = found
    if isinstance(source, Missing):
        raise InputError(f"{source.name} is not on disk; get it with: {source.how(name)}")
    return source.load()


def tried(
    graph: str,
    options: Options,
    methods: Sequence[str] = (),
    budget_s: float = 60.0,
    tell: Callable[[str], None] = lambda _: None,
) -> Trial:
    """Run candidates on simulated twins of a graph.

    The first twin tells how long a round takes: candidates that fail on it, or are not done by the time that half of
    the budget is spent, are left out of the others. As many twins follow as the budget has time for, at most as many
    as the suite has seeds; one that is not finished by then does not count.

    Parameters
    ----------
    graph
        A path, or a selection of a dataset.
    options
        Of the run; `out` is needed. Seeds and the limit of a job are set here.
    methods
        Selections in place of the suite's.
    budget_s
        Seconds for all of it, once every candidate is compiled. The first twin is made and solved by one candidate at
        least, whatever it takes.
    tell
        Is told what is done.

    Raises
    ------
    InputError
        Where no candidate ended well on the first twin.
    """
    suite = load_suite(SUITE)
    options = replace(options, timeout_s=min(suite.timeout_s, _SHARE * budget_s))
    twins = replace(suite, datasets=(_twin(graph, suite, options.plugins),), methods=tuple(methods) or suite.methods)
    _compile(twins, options, tell)
    start = time.monotonic()
    first = _run(twins, 1, options, start + budget_s / 2, tell)
    took = time.monotonic() - start
    ended = score(first.store, jobs=[cell.job for cell in first.cells]).frame
    left_out = tuple(_left_out(ended))
    well = [cell.job for cell, how in zip(first.cells, ended["outcome"], strict=True) if how == OK]
    if not well:
        raise InputError(f"no candidate solved the simulated twin of {graph}: {'; '.join(left_out)}")
    able = replace(twins, methods=tuple(dict.fromkeys(job.label for job in well)))
    count = max(1, min(suite.seeds, int(budget_s / took)))
    whole = _run(able, count, options, start + budget_s, tell) if count > 1 else first
    kept = _of_complete_twins(whole, able.methods)
    return Trial(
        results=score(whole.store, jobs=kept),
        twins=len({job.seed for job in kept}),
        closures_deg=_closures_deg(whole.store, dict.fromkeys(job.instance_key for job in kept)),
        left_out=left_out,
        seconds=time.monotonic() - start,
    )


def _compile(suite: Suite, options: Options, tell: Callable[[str], None]) -> None:
    """Let the candidates solve a triangle: what this machine compiled before must not decide who takes part."""
    tell(f"compiling {counted(len(suite.methods), 'candidate')}, where that was not done before")
    with tempfile.TemporaryDirectory(prefix="recommend-") as folder:
        triangle = Path(folder) / "triangle.npz"
        np.savez(triangle, edges=[[0, 1], [0, 2], [1, 2]], rotations=np.tile(np.eye(3), (3, 1, 1)))
        small = replace(suite, datasets=(catalog("dataset").with_paths(str(triangle)),), seeds=1)
        run = Run(small, (), (), replace(options, out=Path(folder) / "run"))
        run.prepare()
        for _ in run.execute():
            pass


def _of_complete_twins(run: Run, methods: Collection[str]) -> list[Job]:
    """Jobs of these methods on the twins that all of them were run on."""
    jobs = [cell.job for cell in run.cells if cell.job.label in methods]
    unfinished = {job.seed for job in jobs if run.store.record(job.id) is None}
    return [job for job in jobs if job.seed not in unfinished]


def _closures_deg(store: Store, twins: Iterable[str]) -> tuple[float, ...]:
    """Medians over twins of the quantiles of how far their triangles are from closing; none without triangles."""
    found = [look(store.instance(key).problem).closures_deg for key in twins]
    return tuple(np.median(found, axis=0).tolist())


def _twin(graph: str, suite: Suite, plugins: Sequence[Path]) -> str:
    """The suite's dataset with the graph in place of its own."""
    [dataset] = suite.datasets
    return format_selection(parse(dataset).name, {"of": catalog("dataset", plugins).with_paths(graph)})


def _run(suite: Suite, seeds: int, options: Options, until: float, tell: Callable[[str], None]) -> Run:
    """Run the first seeds of the suite; what is not done by a time is left, but for the first job."""
    run = Run(replace(suite, seeds=seeds), (), (), options)
    run.prepare()
    left = max(until - time.monotonic(), 0)
    tell(f"{counted(len(run.todo), 'job')} on {counted(seeds, 'simulated twin')}, in {left:.0f} s at most")
    for _ in run.execute():
        if time.monotonic() > until:
            break
    return run


def _left_out(frame: "pd.DataFrame") -> Iterator[str]:
    for row in frame[frame["outcome"] != OK].to_dict("records"):
        why = "the budget was spent before its turn" if row["outcome"] == NOT_RUN else row["status"]
        yield f"{label(row['method'], row['params'])}: {why}"
