"""The graphs that a network learns from, and those it is held out from: made once, from seeds that never meet."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count, cycle, islice
from pathlib import Path

import numpy as np

from bench.core.errors import InputError
from bench.core.problem import Instance
from bench.core.seeds import stream
from bench.plugins.catalog import catalog
from bench.plugins.declare import Missing, Source
from bench.plugins.sources import sources_of

_SPAN = 1_000_000  # seeds of data that belong to one seed of training; the second half is held out


@dataclass(frozen=True, eq=False)
class Graphs:
    """Instances whose truth is known.

    Parameters
    ----------
    learned, held_out
        Connected, every camera with a truth; no two from the same seed and source.
    absent
        A sentence for each selection that gave none.
    """

    learned: tuple[Instance, ...]
    held_out: tuple[Instance, ...]
    absent: tuple[str, ...] = ()

    @property
    def sha256(self) -> str:
        """Hash of the graphs learned from, their measurements and their truth, in order."""
        total = hashlib.sha256()
        for graph in self.learned:
            for array in (graph.problem.edges, graph.problem.rotations, graph.truth):
                total.update(np.ascontiguousarray(array).tobytes())
        return total.hexdigest()

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader must know of them."""
        return tuple(dict.fromkeys(note for graph in self.learned for note in graph.notes))

    @property
    def sources(self) -> tuple[str, ...]:
        """What they were made of, in words."""
        return tuple(sorted({graph.source or graph.name for graph in self.learned}))


def gather(
    selections: Sequence[str],
    learned: int,
    held_out: int,
    seed: int,
    data_dir: Path | None = None,
    plugins: Sequence[Path] = (),
) -> Graphs:
    """Make graphs from selections of datasets, as many of each.

    Parameters
    ----------
    learned, held_out
        How many.
    seed
        Other seeds give other graphs throughout.
    data_dir
        Where datasets look for files first, such as topologies.

    Raises
    ------
    InputError
        Where no selection has a graph, where one has none that change with the seed, or graphs without truth.
    """
    supplies = [_Supply(text, data_dir, plugins) for text in selections]
    present = [supply for supply in supplies if not supply.absent]
    absent = tuple(supply.absent for supply in supplies if supply.absent)
    if not present:
        raise InputError(f"there is nothing to learn from: {'; '.join(absent) or 'no dataset is named'}")
    first = seed * _SPAN
    return Graphs(_taken(present, learned, first), _taken(present, held_out, first + _SPAN // 2), absent)


def _taken(supplies: Sequence["_Supply"], wanted: int, first: int) -> tuple[Instance, ...]:
    """So many graphs, one of each selection in turn, from the seeds that begin with the first."""
    turns = cycle([supply.sources(first) for supply in supplies])
    return tuple(_usable(next(turn)) for turn in islice(turns, wanted))


class _Supply:
    """The sources of one selection, without end.

    Parameters
    ----------
    text
        The selection.
    data_dir, plugins
        As of `gather`.
    """

    def __init__(self, text: str, data_dir: Path | None, plugins: Sequence[Path]) -> None:
        self._text, self._data_dir = text, data_dir
        known = catalog("dataset", plugins)
        self._datasets = known.select([known.with_paths(text)])
        self.absent = ""
        if not self._of(0):
            missing = [f"{found.name} of {text} is not on disk; get it with: {how}" for found, how in self._missing()]
            self.absent = missing[0] if missing else f"{text} has no instance"

    def sources(self, first: int) -> Iterator[Source]:
        """Every source of one seed after the other, in random order."""
        for seed in count(first):
            found = self._of(seed)
            yield from (found[k] for k in stream(seed, "train", self._text).permutation(len(found)))

    def _of(self, seed: int) -> list[Source]:
        found = [source for source, _ in self._all(seed) if isinstance(source, Source)]
        if not all(source.seeded for source in found):
            raise InputError(f"{self._text}: no seed changes it, so that nothing of it can be held out; leave it out")
        return found

    def _missing(self) -> Iterator[tuple[Missing, str]]:
        yield from ((found, found.how(name)) for found, name in self._all(0) if isinstance(found, Missing))

    def _all(self, seed: int) -> Iterator[tuple[Source | Missing, str]]:
        for info, parameters in self._datasets:
            configured = info.configure(parameters)
            yield from ((found, info.name) for found in sources_of(info, configured, self._data_dir, seed))


def _usable(source: Source) -> Instance:
    """The largest component of an instance, whose truth must be known throughout."""
    graph = source.load()
    if graph.truth is None or np.isnan(graph.truth).any():
        raise InputError(f"{source.name}: its truth is not known, so that nothing can be learned from it; leave it out")
    if not graph.problem.components.any():
        return graph
    cameras = np.flatnonzero(graph.problem.components == 0)
    problem, edges = graph.problem.subgraph(cameras)
    outliers = None if graph.outliers is None else graph.outliers[edges]
    return Instance(problem, graph.truth[cameras], graph.name, outliers, source=graph.source, notes=graph.notes)
