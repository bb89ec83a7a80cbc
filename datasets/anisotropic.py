"""Anisotropic: edges whose accuracy differs between directions, as bundle adjustment of two views knows it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench import Floats, InputError, Instance, Missing, Source, dataset
from bench.formats.archive import names as arrays_of
from bench.formats.graph import GraphFile, build
from bench.formats.matlab import read_arrays
from bench.formats.npz import known_rotations, read_npz, read_npz_rotations

from ._files.folders import chosen, named, places, revision
from ._files.repository import Repository, repository, state
from ._simulated.statistics import statistics

FOLDER = "anisotropic"
PUBLISHED = "lu_sphinx"
NEEDED = {"edges", "rotations", "truth", "hessians"}


@dataset("anisotropic", title="Anisotropic", cite="olsson2025", fetchable=True)
@dataclass(frozen=True)
class Anisotropic:
    """A ring of photographs with the Hessian of each relative rotation, and no outliers to speak of.

    lu_sphinx of Olsson et al. (2025): 70 cameras, 1207 edges, residuals with a median of 0.30 degrees and none
    above 24. The Hessians of two-view bundle adjustment are precisions of d in R_ij = exp(d) R_i R_j^T, up to one
    scale. The truth is a bundle-adjusted reconstruction.

    A scene is ``lu_sphinx.mat``, as published, or ``<scene>.npz`` with ``edges``, ``rotations``, ``hessians`` and
    ``truth``, in the folder the user names, in that of the environment variable ``ROTSYNC_DATA_DIR`` or among the
    downloads, or in ``anisotropic/`` below one of these.

    Parameters
    ----------
    scene
        One scene; None for all.
    """

    scene: str | None = None

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source | Missing]:
        """Scenes in alphabetical order; the published one as `Missing` where it is not on disk.

        Raises
        ------
        InputError
            On a scene that is neither published nor on disk, or a data folder that does not exist.
        """
        found = _found(data_dir)
        for name in chosen(self.scene, {PUBLISHED, *found}, "scene of anisotropic"):
            yield _source(found[name]) if name in found else Missing(name)

    def fetch(self, folder: Path | None = None, *, source: Repository | None = None, progress: bool = True) -> Path:
        """Download the published scene, 0.2 MB, to ``anisotropic/`` in `folder`, by default the cache.

        Raises
        ------
        InputError
            As `Repository.fetch`.
        """
        return (source or _public()).fetch(folder, progress) / FOLDER

    def verify(self, data_dir: Path | None) -> list[tuple[str, str]]:
        """Read every scene on disk: its name with "ok" or with what is wrong."""
        found = _found(data_dir)
        if not found:
            raise InputError("no scene of anisotropic is on disk; get it with: data fetch anisotropic")
        return [(name, state([path], _public(), _source(path).load, "anisotropic")) for name, path in found.items()]


def _public() -> Repository:
    return repository("anisotropic-ra")


def _found(data_dir: Path | None) -> dict[str, Path]:
    found = named(places(data_dir, FOLDER), ["*.npz", f"{PUBLISHED}.mat"])
    return {name: path for name, path in found.items() if path.suffix == ".mat" or arrays_of(path) >= NEEDED}


def _source(path: Path) -> Source:
    identity = revision([path])
    return Source(path.stem, identity, lambda: _load(path, identity))


def _load(path: Path, identity: str) -> Instance:
    graph, truth = read_blocks(path) if path.suffix == ".mat" else (read_npz(path), read_npz_rotations(path).rotations)
    if len(truth) != graph.problem.n:
        raise InputError(f"{path}: 'truth' is of {len(truth)} cameras, and the graph has {graph.problem.n}")
    return Instance(
        graph.problem,
        truth,
        name=path.stem,
        source=f"anisotropic-ra: {path.name}",
        revision=identity,
        notes=graph.notes,
        statistics=statistics(graph.problem),
    )


def read_blocks(path: Path) -> tuple[GraphFile, Floats]:
    """Graph and truth (n, 3, 3) of the file as the authors publish it.

    Block (i, j), i < j, of ``Rrel`` is R_j R_i^T, zero where there is no edge, and its Hessian is tr(M) I - M of the
    block M of ``Alpha``, in frame j.

    Raises
    ------
    InputError
        Naming the file, and the array or the cameras where one is at fault.
    """
    arrays = read_arrays(path, {"Rrel": "3n x 3n", "Alpha": "3n x 3n", "Rgt": "3n x 3"})
    relative, alpha, true = arrays["Rrel"], arrays["Alpha"], arrays["Rgt"]
    n = len(true) // 3
    if (relative.shape, alpha.shape, true.shape) != ((3 * n, 3 * n), (3 * n, 3 * n), (3 * n, 3)):
        shapes = f"{relative.shape}, {alpha.shape} and {true.shape}"
        raise InputError(f"{path}: Rrel, Alpha and Rgt must be 3n x 3n, 3n x 3n and 3n x 3, not {shapes}")
    blocks, costs = (matrix.reshape(n, 3, n, 3).transpose(0, 2, 1, 3) for matrix in (relative, alpha))
    edges = np.argwhere(np.triu(blocks.any(axis=(2, 3)), 1))
    i, j = edges.T
    of_cost = costs[i, j]
    with np.errstate(all="ignore"):  # what is not finite is found where precisions are checked
        hessians = np.trace(of_cost, axis1=1, axis2=2)[:, None, None] * np.eye(3) - of_cost
        hessians = (hessians + hessians.transpose(0, 2, 1)) / 2
    graph = build(
        edges[:, ::-1],  # the measurement and its Hessian are those of edge (j, i)
        blocks[i, j],
        lambda row: f"{path}: cameras {i[row]} and {j[row]}",
        cameras=np.arange(n),
        precisions=hessians,
    )
    return graph, known_rotations(true.reshape(n, 3, 3), lambda row: f"{path}: Rgt, camera {row}")
