"""View graphs of real scenes, with simulated measurements on their edges."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bench import Instance, Missing, Problem, Source, dataset, parameter, so3, stream, suggestion
from bench.formats.npz import read_topology

from ._files.folders import named, places, revision
from ._simulated.measurements import CODE, Measurements, OutlierModel
from ._simulated.noise import Noise
from ._simulated.statistics import statistics

FOLDER = "viewgraphs"
NOTE = "simulated measurements: only who is connected to whom is real; do not compare with published tables"


@dataset("view-graph", title="View graphs, simulated measurements", cite="wilson2014")
@dataclass(frozen=True)
class ViewGraph:
    """The topology of real scenes, at their size and connectivity, with simulated measurements.

    A scene is ``<Scene>.npz``, with ``n`` and ``edges`` (m, 2), in the folder the user names, in that of the
    environment variable ``ROTSYNC_DATA_DIR`` or among the downloads, or in ``viewgraphs/`` below one of these.
    Absolute rotations are uniform; edges are measured as in ``erdos-renyi``, where real scenes have outliers
    that agree with each other and noise that differs from edge to edge.

    Parameters
    ----------
    scene
        One scene; None for all that are on disk.
    noise_deg, outliers, outlier_model, noise
        As in ``erdos-renyi``.
    """

    scene: str | None = None
    noise_deg: float = parameter(5.0, at_least=0, at_most=180)
    outliers: float = parameter(0.4, at_least=0, at_most=1)
    outlier_model: OutlierModel = "haar"
    noise: Noise = "paper"

    def __post_init__(self) -> None:
        if self.scene is not None and Path(self.scene).name != self.scene:
            raise ValueError(f"scene is a name without folders and without .npz, not '{self.scene}'")

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source | Missing]:
        """Scenes in alphabetical order, one instance of each for each seed.

        Raises
        ------
        InputError
            On a data folder that does not exist.
        """
        folders = places(data_dir, FOLDER)
        found = named(folders, ["*.npz"])
        wanted = list(found) if self.scene is None else [self.scene]
        for scene in wanted:
            if scene in found:
                yield self._source(found[scene], seed)
            else:
                yield Missing(scene, _how_to_get(scene, folders[0]) + suggestion(scene, found))
        if not wanted:
            yield Missing("any scene", _how_to_get("<Scene>", folders[0]))

    def _source(self, path: Path, seed: int) -> Source:
        measurements = Measurements.of(self)
        name = "-".join([path.stem, *measurements.label()])
        identity = revision([path, Path(__file__), *CODE], repr(measurements), str(seed))
        return Source(name, identity, lambda: _load(path, measurements, name, seed, identity), seeded=True)


def _how_to_get(scene: str, folder: Path) -> str:
    return f"put {scene}.npz, with 'n' and 'edges', in {folder} or name its folder with --data-dir"


def _load(path: Path, measurements: Measurements, name: str, seed: int, identity: str) -> Instance:
    n, edges = read_topology(path)
    rng = stream(seed, "data", "view-graph", path.stem)
    truth = so3.random(rng, n)
    rotations, outliers = measurements.simulate(truth, edges, rng)
    problem = Problem(n, edges, rotations)
    return Instance(
        problem,
        truth,
        name=name,
        outliers=outliers,
        source=f"{path.name}, simulated measurements with {measurements.noise} noise",
        revision=identity,
        notes=(NOTE,),
        statistics=statistics(problem),
    )
