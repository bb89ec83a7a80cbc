"""Scan graphs: all pairs of the depth scans of a scene, registered, most of them wrongly."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from bench import Floats, InputError, Instance, Missing, Source, dataset
from bench.formats.graph import GraphFile, build
from bench.formats.matlab import read_arrays
from bench.formats.npz import known_rotations, read_npz, read_npz_rotations

from ._files.folders import chosen, named, places, revision
from ._files.repository import Repository, repository, state
from ._simulated.statistics import statistics

Collection = Literal["scannet", "redwood"]
Split = Literal["train", "test", "other", "all"]

FAILED = 1e6  # residual that the authors give to a pair without registration
TITLES = {"scannet": "ScanNet", "redwood": "Redwood"}


@dataset("scan-graph", title="Complete scan graphs", cite="huang2019", fetchable=True)
@dataclass(frozen=True)
class ScanGraph:
    """Scans of a scene, all pairs of them registered by fast global registration and ICP, two thirds of them wrongly.

    Of Huang et al. (2019): 100 scans of each of 152 scenes of ScanNet, 50 scans of each of 58 objects of Redwood. Pairs
    without overlap are edges too, so that 10 to 72 % of a scene's edges are within 10 degrees of the truth. The
    authors keep the residual of each registration; it tells right from wrong edges badly (area under the ROC curve 0.70
    and 0.64) and is not taken for a weight. The truth is BundleFusion's of ScanNet, and of Redwood the reconstruction
    of each object, with three digits.

    A scene is ``<scene>.mat``, as published, or ``<scene>.npz`` with ``edges``, ``rotations`` and ``truth``, in
    ``scannet_fgr/`` and ``redwood_fgr/`` below the folder the user names, that of the environment variable
    ``ROTSYNC_DATA_DIR`` or the downloads; ``scannet/fgr/`` and ``redwood/fgr/``, as in the authors' repository, do too.

    Parameters
    ----------
    collection
        ``scannet`` or ``redwood``.
    scene
        One scene; None for all of the split.
    split
        The authors' ``train`` (40 and 33 scenes) and ``test`` (20 and 25), the ``other`` scenes, which they use for
        neither, or ``all``. Has no meaning where one scene is named.
    """

    collection: Collection = "scannet"
    scene: str | None = None
    split: Split = "train"

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source | Missing]:
        """Scenes in alphabetical order; published ones that are not on disk as `Missing`.

        Raises
        ------
        InputError
            On a scene that is neither published nor on disk, or a data folder that does not exist.
        """
        found = self._found(data_dir)
        known = {name.stem for name in _public().names if name.match(f"{self.collection}_fgr/*.mat")} | found.keys()
        for name in chosen(self.scene, known, f"scene of scan-graph[collection={self.collection}]:"):
            if self.scene or self.split in ("all", _split(name)):
                yield self._source(found[name]) if name in found else Missing(name)

    def fetch(self, folder: Path | None = None, *, source: Repository | None = None, progress: bool = True) -> Path:
        """Download all scenes of both collections, 100 MB in 210 files, into `folder`, by default the cache.

        Raises
        ------
        InputError
            As `Repository.fetch`.
        """
        return (source or _public()).fetch(folder, progress)

    def verify(self, data_dir: Path | None) -> list[tuple[str, str]]:
        """Read every scene on disk, of both collections: its name with "ok" or with what is wrong."""
        states = [
            (name, state([path], _public(), self._source(path).load, "scan-graph"))
            for collection in get_args(Collection)
            for name, path in dataclasses.replace(self, collection=collection)._found(data_dir).items()
        ]
        if not states:
            raise InputError("no scene of scan-graph is on disk; get them with: data fetch scan-graph")
        return states

    def _found(self, data_dir: Path | None) -> dict[str, Path]:
        folders = places(data_dir, f"{self.collection}_fgr", f"{self.collection}/fgr")
        return named([folder for folder in folders if self._is_collection(folder)], ["*.npz", "*.mat"])

    def _is_collection(self, folder: Path) -> bool:
        """Whether its name, or that and its parent's, are the collection's: the user may name the folder itself."""
        return f"{self.collection}_fgr" == folder.name or (self.collection, "fgr") == folder.parts[-2:]

    def _source(self, path: Path) -> Source:
        identity = revision([path])
        return Source(path.stem, identity, lambda: _load(path, self.collection, identity))


def _public() -> Repository:
    return repository("learning2sync")


def _split(scene: str) -> str:
    groups = _public().groups
    return next((split for split, names in groups.items() if scene in names), "other")


def _load(path: Path, collection: str, identity: str) -> Instance:
    graph, truth = read_summary(path) if path.suffix == ".mat" else (read_npz(path), read_npz_rotations(path).rotations)
    if truth.shape != (graph.problem.n, 3, 3):
        raise InputError(f"{path}: 'truth' is of {len(truth)} scans, and the graph has {graph.problem.n}")
    return Instance(
        dataclasses.replace(graph.problem, weights=None, precisions=None),
        truth,
        name=path.stem,
        source=f"Learning2Sync, {TITLES[collection]}, fast global registration: {path.name}",
        revision=identity,
        notes=graph.notes,
        statistics=statistics(graph.problem),
        collection=TITLES[collection],
    )


def read_summary(path: Path) -> tuple[GraphFile, Floats]:
    """Graph and truth (n, 3, 3) of a summary as the authors publish it.

    Block (i, j), i < j, of ``T`` is X_j X_i^-1 for scans whose poses X take the world to the scan, so that its
    rotation is the transpose of R_ij; ``Tstar`` holds the true X.

    Raises
    ------
    InputError
        Naming the file, and the array or the scans where one is at fault.
    """
    arrays = read_arrays(path, {"T": "4n x 4n", "Tstar": "n x 4 x 4", "sigma": "n x n"})
    poses, true, residuals = arrays["T"], arrays["Tstar"], arrays["sigma"]
    n = len(residuals)
    if (poses.shape, true.shape, residuals.shape) != ((4 * n, 4 * n), (n, 4, 4), (n, n)):
        shapes = f"{poses.shape}, {true.shape} and {residuals.shape}"
        raise InputError(f"{path}: T, Tstar and sigma must be 4n x 4n, n x 4 x 4 and n x n, not {shapes}")
    edges = np.argwhere(np.triu(residuals < FAILED, 1))
    i, j = edges.T
    if len(edges) == 0:
        raise InputError(f"{path}: no pair of scans is registered")
    blocks = poses.reshape(n, 4, n, 4)[i, :3, j, :3]
    graph = build(
        edges, blocks.transpose(0, 2, 1), lambda row: f"{path}: scans {i[row]} and {j[row]}", cameras=np.arange(n)
    )
    return graph, known_rotations(true[:, :3, :3], lambda row: f"{path}: Tstar, scan {row}")
