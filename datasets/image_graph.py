"""Image graphs: two-view geometry between photographs as COLMAP estimates it, with its match counts."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from bench import InputError, Instance, Missing, Source, dataset
from bench.formats.archive import names as arrays_of
from bench.formats.npz import read_npz, read_npz_rotations

from ._files.folders import chosen, named, places, revision
from ._simulated.statistics import statistics

Weights = Literal["counts", "covariances"]

DEFAULT: Weights = "counts"
FOLDER = "image_graphs"
NEEDED = {"edges", "rotations", "truth"}
SCENES = ("castle-P30", "fountain-P11", "lego")
COMMAND = (
    "no download, there is no public archive: put <scene>.npz, with edges, rotations, weights and truth, into "
    f"{FOLDER}/ of a folder and name that with --data-dir; the docstring of image-graph says how they are made"
)


@dataset("image-graph", title="Image graphs", cite="schonberger2016, strecha2008")
@dataclass(frozen=True)
class ImageGraph:
    """Photographs whose cameras are known, with relative rotations by COLMAP at its defaults.

    What a user of COLMAP has: match counts, covariances, and wrong pairs where structures repeat. castle-P30 and
    fountain-P11 (Strecha et al. 2008) are of laser-registered cameras; lego is a hundred renderings of NeRF's synthetic
    scene with exact cameras and gravity. The graphs were made by pycolmap: SIFT features, exhaustive matching and
    two-view geometry with known intrinsics, 15 inlier matches or more. No archive of them is public.

    A scene is ``<scene>.npz`` in the folder the user names, in that of the environment variable ``ROTSYNC_DATA_DIR``
    or among the downloads, or in ``image_graphs/`` below one of these: ``edges`` (m, 2), ``rotations`` (m, 3, 3),
    ``weights`` (m,) or ``num_matches`` (m,) and ``truth`` (n, 3, 3), and where known ``covariances`` (m, 3, 3) of d in
    R_ij = exp(d) R_i R_j^T and ``gravity`` (n, 3). Archives without truth and counts are not taken for image graphs.

    Parameters
    ----------
    scene
        One scene; None for all.
    weights
        What comes with the measurements. ``counts`` are the inlier matches. ``covariances`` are scalar precisions, the
        inverse of the trace of each covariance: what two-view bundle adjustment says of its rotation is 4 to 8 times
        too small in sigma, because wrong matches are not in it; it ranks edges well, but as full matrices in
        rad^-2 it would be believed too much.
    """

    scene: str | None = None
    weights: Weights = DEFAULT

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source | Missing]:
        """Scenes in alphabetical order; those we know of that are not on disk as `Missing`.

        Raises
        ------
        InputError
            On a scene that is neither known nor on disk, or a data folder that does not exist.
        """
        found = {name: path for name, path in named(places(data_dir, FOLDER), ["*.npz"]).items() if _is_one(path)}
        for name in chosen(self.scene, {*SCENES, *found}, "scene of image-graph"):
            yield self._source(found[name]) if name in found else Missing(name, COMMAND)

    def _source(self, path: Path) -> Source:
        identity = revision([path], self.weights)
        name = path.stem if self.weights == DEFAULT else f"{path.stem}-{self.weights}"
        return Source(name, identity, lambda: _load(path, self.weights, name, identity))


def _is_one(path: Path) -> bool:
    arrays = arrays_of(path)
    return arrays >= NEEDED and bool(arrays & {"weights", "num_matches"})


def _load(path: Path, weights: Weights, name: str, identity: str) -> Instance:
    graph = read_npz(path)
    truth = read_npz_rotations(path).rotations
    if len(truth) != graph.problem.n:
        raise InputError(f"{path}: 'truth' is of {len(truth)} cameras, and the graph has {graph.problem.n}")
    problem = replace(graph.problem, precisions=None)
    if weights == "covariances":
        informed = np.zeros(1) if graph.problem.precisions is None else np.linalg.eigvalsh(graph.problem.precisions)
        if not (informed > 0).all():
            raise InputError(f"{path}: there are no positive 'covariances' of every edge in it; choose weights=counts")
        problem = replace(problem, weights=1 / (1 / informed).sum(axis=1), weights_kind="precision")
    return Instance(
        problem,
        truth,
        name=name,
        source=f"two-view geometry by COLMAP: {path.name}, weights from {weights}",
        revision=identity,
        notes=graph.notes,
        statistics=statistics(problem),
    )
