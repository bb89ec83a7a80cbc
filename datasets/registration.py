"""Registration: fragments of indoor scans, with the relative poses that geometric descriptors gave."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench import InputError, Instance, Missing, Source, dataset, suggestion
from bench.formats.registration_log import read_log, read_log_rotations

from ._files.folders import chosen, places, revision
from ._files.repository import Repository, repository, state
from ._simulated.statistics import statistics

FOLDER = "registration"
TRUTH = "gt.log"
DEFAULT = "3dmatch"
RENDERED = "iclnuim-"
SUFFIX = "-evaluation"  # of the scenes' folders in the authors' repository
UNSCORED = f"no ground truth ({TRUTH} is missing): not scored, cost and time only"


@dataset("registration", title="Registration of fragments", cite="zeng2017, choi2015", fetchable=True)
@dataclass(frozen=True)
class Registration:
    """Fragments of depth scans, matched in pairs by a descriptor and RANSAC: the benchmark of 3DMatch.

    Nodes are fragments of fifty frames; an edge is a pair that the evaluation of Zeng et al. (2017) accepted for its
    overlap, right or wrong: 26 to 94 % of a scene's edges are within 10 degrees of the truth. Many of the others are
    near 90 or 180 degrees (corners of rooms), so that they agree with each other. The scenes named ``iclnuim`` are
    rendered (Choi, Zhou and Koltun 2015): their truth is exact, and four descriptors were tried on the same pairs. The
    truth of the others comes from reconstructions by the authors of 7-Scenes and SUN3D.

    A scene is a folder with ``<descriptor>.log`` and ``gt.log``, in the folder the user names, in that of the
    environment variable ``ROTSYNC_DATA_DIR`` or among the downloads, or in ``registration/`` below one of these. The
    true relative poses are chained over the largest component that they connect; the truth of fragments outside it is
    unknown.

    Parameters
    ----------
    scene
        One scene; None for all that the descriptor has.
    descriptor
        ``3dmatch``; of the ICL-NUIM scenes also ``fpfh``, ``spin`` and ``pcl_modified``.
    """

    scene: str | None = None
    descriptor: str = DEFAULT

    def __post_init__(self) -> None:
        if not self.descriptor or Path(self.descriptor).name != self.descriptor:
            raise ValueError(f"descriptor is a name without folders and without .log, not '{self.descriptor}'")

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source | Missing]:
        """Scenes in alphabetical order; published ones that are not on disk as `Missing`.

        Raises
        ------
        InputError
            On a scene or descriptor that is neither published nor on disk, or a data folder that does not exist.
        """
        found = self._found(data_dir)
        known = {name.parent.name for name in _public().names if name.name == f"{self.descriptor}.log"} | found.keys()
        if not known:
            every = {name.stem for name in _public().names} - {Path(TRUTH).stem, "LICENSE"}
            raise InputError(f"registration has no '{self.descriptor}.log'{suggestion(self.descriptor, every)}")
        for name in chosen(self.scene, known, f"scene of registration with {self.descriptor}.log:"):
            yield self._source(name, found[name]) if name in found else Missing(self._label(name))

    def fetch(self, folder: Path | None = None, *, source: Repository | None = None, progress: bool = True) -> Path:
        """Download the logs of all scenes and descriptors, 3 MB, to ``registration/`` in `folder` or the cache.

        Raises
        ------
        InputError
            As `Repository.fetch`.
        """
        return (source or _public()).fetch(folder, progress) / FOLDER

    def verify(self, data_dir: Path | None) -> list[tuple[str, str]]:
        """Read every scene on disk: its name with "ok" or with what is wrong."""
        found = self._found(data_dir)
        if not found:
            raise InputError("no scene of registration is on disk; get them with: data fetch registration")
        return [
            (name, state(log.parent.glob("*.log"), _public(), self._source(name, log).load, "registration"))
            for name, log in found.items()
        ]

    def _found(self, data_dir: Path | None) -> dict[str, Path]:
        """The log of each scene on disk; of two of one name, the one that is found first."""
        found: dict[str, Path] = {}
        for folder in places(data_dir, FOLDER):
            for log in folder.glob(f"*/{self.descriptor}.log"):
                found.setdefault(log.parent.name.removesuffix(SUFFIX), log)
        return dict(sorted(found.items()))

    def _label(self, scene: str) -> str:
        """A name for tables, which have the scenes of all descriptors."""
        return scene if self.descriptor == DEFAULT else f"{scene}-{self.descriptor}"

    def _source(self, scene: str, log: Path) -> Source:
        identity, name = revision(_files(log)), self._label(scene)
        return Source(name, identity, lambda: _load(name, log, identity))


def _public() -> Repository:
    return repository("3dmatch-toolbox")


def _files(log: Path) -> list[Path]:
    """The log and what is read with it, as far as it is there."""
    return [path for path in (log, log.with_suffix(".info"), log.parent / TRUTH) if path.is_file()]


def _load(name: str, log: Path, identity: str) -> Instance:
    graph = read_log(log)
    path = log.parent / TRUTH
    truth, notes = None, (*graph.notes, UNSCORED)
    if path.is_file():
        true = read_log_rotations(path)
        truth = true.of(graph)
        unknown = int(np.isnan(truth).any(axis=(1, 2)).sum())
        outside = f"the truth of {unknown} of {graph.problem.n} fragments is unknown: {TRUTH} does not connect them"
        notes = (*graph.notes, *(note for note in true.notes if "contradict" in note), *([outside] if unknown else []))
    return Instance(
        graph.problem,
        truth,
        name=name,
        source=f"3DMatch, {log.parent.name}: {log.name}{' and ' + TRUTH if truth is not None else ''}",
        revision=identity,
        notes=notes,
        statistics=statistics(graph.problem),
        ids=graph.cameras,
        collection="ICL-NUIM" if name.startswith(RENDERED) else "3DMatch",
    )
