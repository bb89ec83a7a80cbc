"""View graphs of real scenes, with simulated measurements on their edges."""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Literal

from bench import Instance, Missing, Problem, Source, dataset, parameter, so3, stream, suggestion
from bench.formats.npz import read_topology

from ._files.folders import named, places, revision
from ._simulated import correlated, snowball
from ._simulated.correlated import Law
from ._simulated.measurements import CODE, Measurements, OutlierModel
from ._simulated.noise import Noise
from ._simulated.sizes import Sizes
from ._simulated.statistics import statistics

FOLDER = "viewgraphs"
_CODE = (Path(__file__), Path(str(snowball.__file__)), *CODE, *correlated.CODE)  # decides what is simulated
NOTE = "simulated measurements: only who is connected to whom is real; do not compare with published tables"


@dataset("view-graph", title="View graphs, simulated measurements", cite="wilson2014")
@dataclass(frozen=True)
class ViewGraph:
    """The topology of real scenes, at their size and connectivity, with simulated measurements.

    A scene is ``<Scene>.npz``, with ``n`` and ``edges`` (m, 2), in the folder the user names, in that of the
    environment variable ``ROTSYNC_DATA_DIR`` or among the downloads, or in ``viewgraphs/`` below one of these.
    By default absolute rotations are uniform and edges are measured as in ``erdos-renyi``, each with an error of its
    own. With ``noise=correlated`` cameras are upright, errors are correlated at cameras as on real scenes, and every
    parameter of the law that is not given is drawn for each graph and seed: see ``_simulated/correlated.py``.

    Parameters
    ----------
    scene
        One scene; None for all that are on disk.
    cameras
        Of a piece of the scene instead of the whole, another for each seed: what a breadth-first search from a random
        camera, to neighbours in random order, meets first, with all edges within; None for the whole.
    noise
        ``correlated``, or as in ``erdos-renyi``.
    noise_deg
        As in ``erdos-renyi``, by default 5; of correlated noise the median error of an edge, by default drawn.
    outliers
        Fraction of the edges, by default 0.4; of correlated noise those wrong by more than 20 degrees, by default
        drawn, to which a fold adds its own.
    outlier_model
        Of independent noise: as in ``erdos-renyi``, by default ``haar``.
    """

    scene: str | None = None
    noise_deg: float | None = parameter(None, at_least=0, at_most=180)
    outliers: float | None = parameter(None, at_least=0, at_most=1)
    outlier_model: OutlierModel | None = None
    noise: Noise | Literal["correlated"] = "paper"
    cameras: int | None = parameter(None, at_least=3)

    def __post_init__(self) -> None:
        if self.scene is not None and Path(self.scene).name != self.scene:
            raise ValueError(f"scene is a name without folders and without .npz, not '{self.scene}'")
        if self.noise == "correlated":
            given = {"median_deg": self.noise_deg, "outliers": self.outliers}
            Sizes(**{name: value for name, value in given.items() if value is not None})
            if self.outlier_model is not None:
                raise ValueError("'outlier_model' has no meaning for noise=correlated")

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
        name = "-".join([path.stem, *self._label()])
        identity = revision([path, *_CODE], repr(replace(self, scene=None)), str(seed))
        return Source(name, identity, lambda: self._load(path, name, seed, identity), seeded=True)

    def _load(self, path: Path, name: str, seed: int, identity: str) -> Instance:
        n, edges = read_topology(path)
        rng, source = stream(seed, "data", "view-graph", path.stem, *self._size()), path.name
        if self.cameras is not None:
            whole = n
            n, edges = snowball.piece(n, edges, self.cameras, rng)
            source = f"{n} of the {whole} cameras of {source}"
        if self.noise == "correlated":
            truth, rotations, outliers = Law.drawn(rng, self.noise_deg, self.outliers).simulate(n, edges, rng)
        else:
            truth = so3.random(rng, n)
            rotations, outliers = self._independent().simulate(truth, edges, rng)
        problem = Problem(n, edges, rotations)
        return Instance(
            problem,
            truth,
            name=name,
            outliers=outliers,
            source=f"{source}, simulated measurements with {self.noise} noise",
            revision=identity,
            notes=(NOTE, correlated.INFORMED) if self.noise == "correlated" else (NOTE,),
            statistics=statistics(problem),
        )

    def _independent(self) -> Measurements:
        given = {f.name: getattr(self, f.name) for f in fields(Measurements) if getattr(self, f.name) is not None}
        return Measurements(**given)

    def _label(self) -> list[str]:
        """``cameras100`` of a piece, then what is given of the noise."""
        if self.noise != "correlated":
            return [*self._size(), *self._independent().label()]
        given = {"noise": self.noise_deg, "outliers": self.outliers}
        told = (f"{key}{value}" for key, value in given.items() if value is not None)
        return [*self._size(), "correlated-noise", *told]

    def _size(self) -> list[str]:
        return [] if self.cameras is None else [f"cameras{self.cameras}"]


def _how_to_get(scene: str, folder: Path) -> str:
    return f"put {scene}.npz, with 'n' and 'edges', in {folder} or name its folder with --data-dir"
