"""Graphs in files of one's own, with the truth where there is one."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from bench import Floats, InputError, Instance, Source, dataset
from bench.formats import GraphFile, holds, read_graph, read_rotations

from ._files.folders import revision
from ._simulated.statistics import statistics

_UNKNOWN = ("no ground truth: not scored, cost and time only",)


@dataset("files", title="Files", takes_paths=True)
@dataclass(frozen=True)
class Files:
    """The graphs in a file or folder of one's own: a path in place of a dataset's name.

    Whatever ``data formats`` lists as a graph is read. A folder that is not a graph itself stands for the graphs in it,
    one instance each.

    Parameters
    ----------
    path
        A file or a folder.
    truth
        Absolute rotations of the cameras: a file, or a folder in which the truth of each graph has the graph's name but
        for its ending. By default the graph's own file, where that holds them too.
    """

    path: str = ""
    truth: str = ""

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source]:
        """The graphs, by their names without ending.

        Raises
        ------
        InputError
            Where there is no such file, or no graph in the folder.
        """
        if not self.path:
            raise InputError("files needs a path, such as files[path=graph.g2o]; or name the path in its place")
        for path in (self.path, self.truth or self.path):
            if not Path(path).exists():
                raise InputError(f"{path}: there is no such file or folder")
        graphs = _graphs(Path(self.path))
        truths = _truths(graphs, Path(self.truth) if self.truth else None)
        for graph, truth in zip(graphs, truths, strict=True):
            files = _content(graph) + (_content(truth) if truth not in (None, graph) else [])
            identity = revision(files)
            yield Source(graph.stem, identity, partial(_load, graph, truth, identity))


def _graphs(place: Path) -> list[Path]:
    if not place.is_dir() or "graph" in holds(place):
        return [place]
    graphs = [path for path in sorted(place.iterdir()) if "graph" in holds(path)]
    if not graphs:
        raise InputError(f"{place}: there is no graph in this folder; what is read is listed by: data formats")
    return graphs


def _truths(graphs: list[Path], truth: Path | None) -> list[Path | None]:
    """The truth of each graph, or None."""
    if truth is None:
        return [graph if "rotations" in holds(graph) else None for graph in graphs]
    if not truth.is_dir() or "rotations" in holds(truth):
        if len(graphs) > 1:
            raise InputError(f"{truth}: there are {len(graphs)} graphs; name a folder with the truth of each")
        return [truth]
    by_name = {path.stem: path for path in sorted(truth.iterdir())}
    return [by_name.get(graph.stem) for graph in graphs]


def _content(path: Path | None) -> list[Path]:
    if path is None:
        return []
    return sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]


def _load(path: Path, truth_path: Path | None, identity: str) -> Instance:
    graph = read_graph(path)
    truth, notes = (None, _UNKNOWN) if truth_path is None else _truth(truth_path, graph)
    return Instance(
        graph.problem,
        truth,
        name=path.stem,
        source=path.name,
        revision=identity,
        notes=(*graph.notes, *notes),
        statistics=statistics(graph.problem),
        ids=graph.cameras,
    )


def _truth(path: Path, graph: GraphFile) -> tuple[Floats, tuple[str, ...]]:
    """Truth (n, 3, 3) of the cameras of a graph, NaN where unknown, and what must be known of it."""
    found = read_rotations(path)
    truth = found.of(graph)
    known = int(np.isfinite(truth).all(axis=(1, 2)).sum())
    if not known:
        by = "names" if found.names is not None and graph.names is not None else "ids"
        raise InputError(f"{path}: none of its {len(found.cameras)} cameras is in the graph, by their {by}")
    partial_truth = (f"truth of {known} of {graph.problem.n} cameras",) if known < graph.problem.n else ()
    return truth, (*found.notes, *partial_truth)
