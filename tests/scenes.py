"""Small scenes in the layout of 1DSfM, made for the tests, and the way to load any instance."""

from pathlib import Path

import numpy as np

from bench.core import so3
from bench.core.problem import Floats, Instance, Ints
from bench.plugins.declare import Dataset, Source

UNREGISTERED = "1 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n"


def egs_line(i: int, j: int, rotation: Floats) -> str:
    """A line of EGs.txt, with six digits as in the official files."""
    return " ".join([str(i), str(j), *(f"{x:.6g}" for x in rotation.ravel()), "0.6 -0.8 0"])


def bundle_camera(rotation: Floats) -> str:
    """Five lines of gt_bundle.out."""
    rows = "\n".join(" ".join(f"{x:.17g}" for x in row) for row in rotation)
    return f"1000.5 0 0\n{rows}\n0.1 0.2 0.3\n"


def write_scene(folder: Path, images: int = 9, unregistered: tuple[int, ...] = (2,)) -> Floats:
    """Write a noise-free scene and return the rotations (images, 3, 3) of all its images.

    Image 0 is outside the component; all pairs of the others are edges; cc.txt is not sorted.
    """
    folder.mkdir(parents=True)
    rotations = so3.random(np.random.default_rng(images), images)
    pairs = [(i, j) for i in range(1, images) for j in range(i + 1, images)]
    lines = [egs_line(i, j, rotations[i] @ rotations[j].T) for i, j in pairs]
    (folder / "EGs.txt").write_text("\n".join(lines) + "\n")
    (folder / "cc.txt").write_text("".join(f"{i}\n" for i in range(images - 1, 0, -1)))
    (folder / "list.txt").write_text("".join(f"images/{k}.jpg 0 1000.5\n" for k in range(images)))
    cameras = [UNREGISTERED if k in (0, *unregistered) else bundle_camera(r) for k, r in enumerate(rotations)]
    points = "1 2 3\n255 255 255\n2 0 1 0.5 0.5 1 1 0.5 0.5\n"
    (folder / "gt_bundle.out").write_text(f"# Bundle file v0.3\n{images} 1\n{''.join(cameras)}{points}")
    return rotations


def the_source(dataset: Dataset, data_dir: Path | None = None, seed: int = 0) -> Source:
    """Return the one instance of a dataset, not loaded."""
    (source,) = dataset.sources(data_dir, seed)
    assert isinstance(source, Source)
    return source


def load(dataset: Dataset, data_dir: Path | None = None, seed: int = 0) -> Instance:
    """Load the one instance of a dataset."""
    source = the_source(dataset, data_dir, seed)
    instance = source.load()
    assert (instance.name, instance.revision) == (source.name, source.revision)
    return instance


def part_of(instance: Instance) -> Ints:
    """Cameras of the turned part of a folded scene, told from the edges across, which are its only outliers.

    R_i^T R_ij R_j is F where i is in the part and its inverse where j is, up to noise; the part is the smaller side.
    """
    assert instance.truth is not None
    assert instance.outliers is not None
    i, j = instance.problem.edges[instance.outliers].T
    turned = np.swapaxes(instance.truth[i], 1, 2) @ instance.problem.rotations[instance.outliers] @ instance.truth[j]
    first = so3.log(turned) @ so3.log(turned[0]) > 0
    sides = np.where(first, i, j), np.where(first, j, i)
    return np.asarray(min(map(np.unique, sides), key=len))
