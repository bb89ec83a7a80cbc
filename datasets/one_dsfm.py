"""1DSfM: the scenes of internet photographs of Wilson and Snavely (2014)."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from bench import Floats, InputError, Instance, Missing, Source, dataset
from bench.formats.graph import GraphFile
from bench.formats.one_dsfm import BUNDLE, COMPONENT, EDGES, IMAGES, read_bundle, read_folder

from ._files.archive import damaged, unpack
from ._files.download import Archive, download
from ._files.folders import cache, chosen, revision, roots
from ._simulated.statistics import statistics

Protocol = Literal["truth-subgraph", "component"]

FILES = (EDGES, COMPONENT, IMAGES, BUNDLE)
FOLDER = "1dsfm"

OFFICIAL = Archive(
    url="http://landmark.cs.cornell.edu/projects/1dsfm/datasets.tar.gz",
    sha256="2a608789cef64083177f68da9dfb725d791cf56ba51684a4a70304f14f0a7147",
    size=682_117_483,
)

# How many cameras of each scene have ground truth, as papers count and score them.
SCENES = {
    "Alamo": 577,
    "Ellis_Island": 227,
    "Gendarmenmarkt": 677,
    "Madrid_Metropolis": 341,
    "Montreal_Notre_Dame": 450,
    "NYC_Library": 332,
    "Notre_Dame": 553,
    "Piazza_del_Popolo": 338,
    "Piccadilly": 2152,
    "Roman_Forum": 1084,
    "Tower_of_London": 472,
    "Trafalgar": 5058,
    "Union_Square": 789,
    "Vienna_Cathedral": 836,
    "Yorkminster": 437,
}


@dataset("1dsfm", title="1DSfM", cite="wilson2014", fetchable=True)
@dataclass(frozen=True)
class OneDSfM:
    """Fifteen scenes of internet photographs, with the output of Bundler as ground truth.

    Scenes are looked for in the folder the user names, in that of the environment variable
    ``ROTSYNC_DATA_DIR`` and among the downloads, as ``<Scene>/`` or ``1dsfm/<Scene>/``; folders there that
    hold an ``EGs.txt`` of a scene of the user's own are found too.

    Parameters
    ----------
    scene
        One scene; None for all.
    protocol
        ``truth-subgraph`` is the founding paper's: the graph induced by the cameras of ``cc.txt`` with
        ground truth, as it is, connected or not. ``component`` is the graph of all cameras of ``cc.txt``,
        scored where there is truth. A scene without ``gt_bundle.out`` always gives the latter, with nothing
        to score.
    """

    scene: str | None = None
    protocol: Protocol = "truth-subgraph"

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source | Missing]:
        """Scenes in alphabetical order; those of the official fifteen that are not on disk as `Missing`.

        Raises
        ------
        InputError
            On a scene that is neither official nor on disk, or a data folder that does not exist.
        """
        found = _scenes(data_dir)
        for name in chosen(self.scene, {*SCENES, *found}, "scene of 1dsfm"):
            yield self._source(found[name]) if name in found else Missing(name)

    def fetch(self, folder: Path | None = None, *, archive: Archive = OFFICIAL, progress: bool = True) -> Path:
        """Download the official archive into `folder`, by default the cache, and unpack what is needed of it.

        What is there already, and as it was unpacked, is not downloaded again; an interrupted download goes
        on; the archive is removed once it is unpacked.

        Returns
        -------
        The folder that holds the scenes.

        Raises
        ------
        InputError
            Where the download fails, or the archive is not the official one or not a safe one.
        """
        folder = cache() if folder is None else Path(folder)
        scenes = folder / FOLDER
        try:
            if damaged(scenes, archive):
                path = download(archive, folder, progress)
                unpack(path, archive, scenes, FILES, progress)
                path.unlink()
        except OSError as error:
            raise InputError(f"{folder}: cannot be written: {error.strerror}") from error
        return scenes

    def verify(self, data_dir: Path | None) -> list[tuple[str, str]]:
        """Read every scene on disk: its name with "ok" or with what is wrong.

        Raises
        ------
        InputError
            Where there is no scene at all.
        """
        found = _scenes(data_dir)
        if not found:
            raise InputError("no scene of 1dsfm is on disk; get them with: data fetch 1dsfm")
        wrong = {folder: damaged(folder, OFFICIAL) for folder in {path.parent for path in found.values()}}
        return [(name, _state(path, wrong[path.parent])) for name, path in sorted(found.items())]

    def _source(self, folder: Path) -> Source:
        protocol: Protocol = self.protocol if (folder / BUNDLE).is_file() else "component"
        identity = revision((folder / name for name in FILES if (folder / name).is_file()), protocol)
        return Source(folder.name, identity, lambda: _load(folder, protocol, identity))


def _scenes(data_dir: Path | None) -> dict[str, Path]:
    """Folder of each scene on disk; of two of one name, the one that is found first."""
    found: dict[str, Path] = {}
    for root in roots(data_dir):
        for edges in (*root.glob(EDGES), *root.glob(f"*/{EDGES}"), *root.glob(f"{FOLDER}/*/{EDGES}")):
            found.setdefault(edges.resolve().parent.name, edges.parent)
    return found


def _load(folder: Path, protocol: Protocol, identity: str) -> Instance:
    graph = read_folder(folder)
    truth = _truth(folder, graph)
    notes = (*graph.notes, *_truth_notes(folder.name, truth))
    problem = graph.problem
    core, ids = problem, graph.cameras
    if truth is not None:
        with_truth = np.flatnonzero(np.isfinite(truth).all(axis=(1, 2)))
        if not np.isin(problem.edges, with_truth).all(axis=1).any():
            raise InputError(f"{folder / BUNDLE}: no edge joins two cameras with ground truth")
        core, _ = problem.subgraph(with_truth)
        if protocol == "truth-subgraph":
            problem, truth, ids = core, truth[with_truth], ids[with_truth]
    return Instance(
        problem,
        truth,
        name=folder.name,
        protocol=protocol,
        source=f"1DSfM, {folder.name}: EGs.txt{'' if truth is None else ' and gt_bundle.out'}",
        revision=identity,
        notes=notes,
        statistics=statistics(problem, hardness_of=core),
        ids=ids,
    )


def _truth(folder: Path, graph: GraphFile) -> Floats | None:
    """Truth (n, 3, 3) of the cameras of a graph, NaN where unknown; None where the scene has none."""
    if not (folder / BUNDLE).is_file():
        return None
    return read_bundle(folder / BUNDLE)[graph.cameras]


def _truth_notes(scene: str, truth: Floats | None) -> tuple[str, ...]:
    """What a reader must know of the truth (n, 3, 3) of a scene."""
    if truth is None:
        return (f"{scene} has no ground truth here ({BUNDLE} is missing): not scored, cost and time only",)
    count = int(np.isfinite(truth).all(axis=(1, 2)).sum())
    published = SCENES.get(scene, count)
    if count == published:
        return ()
    return (
        f"ground truth covers {count} of the {published} cameras that papers score: another subset"
        f"{', an easier one' if count < published else ''}; do not compare with published tables",
    )


def _state(folder: Path, wrong: dict[str, str]) -> str:
    for name, why in wrong.items():
        if name.startswith(f"{folder.name}/"):
            return f"{why}; get it again with: data fetch 1dsfm"
    try:
        _load(folder, "component", "")
    except InputError as error:
        return str(error)
    return "ok"
