"""Pose graphs of robotics: rotations between poses of one moving body."""

import importlib.util
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bench import Instance, Missing, Source, dataset, suggestion
from bench.formats.chain import propagated
from bench.formats.pose_graph import read_pose_graph

from ._files.folders import named, places, revision
from ._simulated.statistics import statistics

SPHERE = "sphere2500"
FOLDER = "pose_graphs"


@dataset("pose-graph", title="Pose graphs", cite="kaess2008")
@dataclass(frozen=True)
class PoseGraph:
    """Pose graphs: sphere2500 with its ground truth, and any g2o file without one.

    Parameters
    ----------
    graph
        ``sphere2500`` (Kaess et al., simulated; 2500 poses, 4949 edges) comes inside GTSAM's wheel, with
        its noise-free edges. Any other name is that of ``<name>.g2o`` in the folder the user names, in that of the
        environment variable ``ROTSYNC_DATA_DIR`` or among the downloads, or in ``pose_graphs/`` below one of these.
        None for sphere2500 and all that are there.
    """

    graph: str | None = SPHERE

    def __post_init__(self) -> None:
        if self.graph is not None and (not self.graph or Path(self.graph).name != self.graph):
            raise ValueError(f"graph is a name without folders and without .g2o, not '{self.graph}'")

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source | Missing]:
        """Graphs, or what to do to get the one that is asked for: sphere2500, then the others in alphabetical order.

        Raises
        ------
        InputError
            On a data folder that does not exist.
        """
        folders = places(data_dir, FOLDER)
        found = named(folders, ["*.g2o"])
        for name in [SPHERE, *sorted(found.keys() - {SPHERE})] if self.graph is None else [self.graph]:
            if name == SPHERE:
                yield self._sphere()
            elif name in found:
                yield _source(found[name])
            else:
                where = f"put {name}.g2o in {folders[0]} or name its folder with --data-dir"
                yield Missing(name, f"{where}{suggestion(name, {SPHERE, *found})}")

    def _sphere(self) -> Source | Missing:
        folder = _gtsam_data()
        measured, noise_free = folder / f"{SPHERE}.txt", folder / f"{SPHERE}_groundtruth.txt"
        if not (measured.is_file() and noise_free.is_file()):
            return Missing(SPHERE, "python -m pip install 'gtsam>=4.3'")
        identity = revision([measured, noise_free])
        return Source(SPHERE, identity, lambda: _load(measured, identity, noise_free))


def _source(path: Path) -> Source:
    identity = revision([path])
    return Source(path.stem, identity, lambda: _load(path, identity))


def _gtsam_data() -> Path:
    """The folder of graphs inside the installed GTSAM, found without importing it; it need not exist."""
    spec = importlib.util.find_spec("gtsam")
    places = spec.submodule_search_locations if spec else None
    return Path(places[0]) / "Data" if places else Path("gtsam-is-not-installed")


def _load(path: Path, identity: str, noise_free: Path | None = None) -> Instance:
    """The graph of a file, with the truth that follows from the noise-free one beside it, where there is one."""
    graph = read_pose_graph(path)
    unscored = "no ground truth (vertices are initial guesses): not scored, cost and time only"
    return Instance(
        graph.problem,
        propagated(read_pose_graph(noise_free).problem) if noise_free else None,
        name=path.stem,
        source=f"GTSAM's Data folder: {path.name}, truth from {noise_free.name}" if noise_free else path.name,
        revision=identity,
        notes=() if noise_free else (*graph.notes, unscored),
        statistics=statistics(graph.problem),
    )
