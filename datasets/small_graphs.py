"""Some twenty small simulated graphs on which libraries have gone wrong before."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bench import Floats, InputError, Instance, Ints, Problem, Source, dataset, so3, stream, suggestion

from ._files.folders import revision
from ._simulated import shapes
from ._simulated.measurements import CODE, Measurements
from ._simulated.statistics import statistics

Carried = Literal["", "counts", "precisions", "gravity"]

DOWN = np.array([0.0, -1.0, 0.0])
GRAVITY_DEG = 1.0  # noise of the measured directions


@dataclass(frozen=True)
class Recipe:
    """How one of the graphs is made.

    Parameters
    ----------
    edges
        Makes its edges (m, 2).
    limit_deg
        Median error that a working method stays below (a robust one, where there are outliers): two and a half times
        or more the largest that `colmap`, `gtsam-gnc`, `gnc`, `l1-irls` and `shonan[loss=huber]` have over ten seeds.
    noise_deg, outliers
        Of the measurements, as in ``erdos-renyi``.
    about_z
        Whether all absolute rotations are about one axis, as of a robot on a floor.
    folded
        Whether the last third of the cameras is repeated structure: a third of the edges to it are wrong, all alike.
    carries
        What comes with the measurements.
    """

    edges: Callable[[np.random.Generator], Ints]
    limit_deg: float
    noise_deg: float = 1.0
    outliers: float = 0.0
    about_z: bool = False
    folded: bool = False
    carries: Carried = ""


RECIPES = {
    "pair": Recipe(lambda _: shapes.path(2), limit_deg=1e-3, noise_deg=0),
    "triangle": Recipe(lambda _: shapes.ring(3), limit_deg=1e-3, noise_deg=0),
    "star": Recipe(lambda _: shapes.star(12), limit_deg=5),
    "path": Recipe(lambda _: shapes.path(20), limit_deg=12),
    "ring": Recipe(lambda _: shapes.ring(30), limit_deg=10),
    "complete": Recipe(lambda _: shapes.complete(20), limit_deg=2.5, noise_deg=2),
    "dense-outliers": Recipe(lambda rng: shapes.random(50, 0.5, rng), limit_deg=3, noise_deg=2, outliers=0.3),
    "sparse-outliers": Recipe(lambda rng: shapes.random(60, 0.15, rng), limit_deg=5, noise_deg=2, outliers=0.15),
    "sequence": Recipe(lambda rng: shapes.sequence(60, 4, 0, rng), limit_deg=6),
    "sequence-closed": Recipe(lambda rng: shapes.sequence(60, 4, 5, rng), limit_deg=3),
    "sequence-outliers": Recipe(lambda rng: shapes.sequence(60, 5, 8, rng), limit_deg=3, outliers=0.1),
    "grid": Recipe(lambda _: shapes.grid(7, 7), limit_deg=4),
    "two-clusters": Recipe(
        lambda rng: shapes.beside(shapes.random(25, 0.4, rng), shapes.random(25, 0.4, rng), 2), limit_deg=3
    ),
    "near-singular": Recipe(lambda _: shapes.ladder(60), limit_deg=10),
    "disconnected": Recipe(
        lambda rng: shapes.beside(shapes.random(30, 0.3, rng), shapes.random(12, 0.5, rng)), limit_deg=2
    ),
    "planar": Recipe(lambda rng: shapes.random(40, 0.3, rng), limit_deg=1.5, about_z=True),
    "planar-outliers": Recipe(lambda rng: shapes.random(40, 0.4, rng), limit_deg=1.5, outliers=0.2, about_z=True),
    "repeated-structure": Recipe(lambda rng: shapes.random(45, 0.5, rng), limit_deg=3, folded=True),
    "parallel-edges": Recipe(
        lambda rng: np.repeat(shapes.random(30, 0.2, rng), 3, axis=0), limit_deg=4, noise_deg=2, outliers=0.1
    ),
    "counts": Recipe(lambda rng: shapes.random(40, 0.4, rng), limit_deg=2, outliers=0.3, carries="counts"),
    "precisions": Recipe(lambda rng: shapes.sequence(40, 4, 6, rng), limit_deg=5, noise_deg=2, carries="precisions"),
    "gravity": Recipe(lambda rng: shapes.random(30, 0.3, rng), limit_deg=4, noise_deg=2, carries="gravity"),
}


@dataset("small-graphs", title="Small graphs", cite="tejus2023")
@dataclass(frozen=True)
class SmallGraphs:
    """Small graphs of every kind that a library's rotation averaging should survive, made from the seed.

    Trees, rings, complete and random graphs, video sequences, near-singular and disconnected ones, planar rotations,
    repeated structure, parallel edges, match counts, information and gravity. Absolute rotations are uniform, or about
    one axis; measurements are those of ``erdos-renyi`` with ``noise=tangent``. The number ``limit_deg`` of an instance
    is the median error that a working method stays below.

    Parameters
    ----------
    graph
        One of them; None for all.
    """

    graph: str | None = None

    def __post_init__(self) -> None:
        if self.graph is not None and self.graph not in RECIPES:
            raise InputError(f"small-graphs has no graph '{self.graph}'{suggestion(self.graph, RECIPES)}")

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source]:
        """One instance of each graph for each seed."""
        for name in RECIPES if self.graph is None else (self.graph,):
            yield self._source(name, seed)

    def _source(self, name: str, seed: int) -> Source:
        identity = revision([Path(__file__), Path(str(shapes.__file__)), *CODE], name, str(seed))
        return Source(name, identity, lambda: _made(name, RECIPES[name], seed, identity), seeded=True)


def _made(name: str, recipe: Recipe, seed: int, identity: str) -> Instance:
    rng = stream(seed, "data", "small-graphs", name)
    edges = recipe.edges(rng)
    n = int(edges.max()) + 1
    truth = so3.exp(rng.uniform(-np.pi, np.pi, (n, 1)) * [0.0, 0.0, 1.0]) if recipe.about_z else so3.random(rng, n)
    measured, outliers = Measurements(recipe.noise_deg, recipe.outliers, noise="tangent").simulate(truth, edges, rng)
    if recipe.folded:
        outliers |= _folded(truth, edges, measured, rng)
    carried = _carried(recipe, truth, edges, measured, outliers, rng)
    problem = Problem(n, edges, measured, **carried)
    return Instance(
        problem,
        truth,
        name=name,
        outliers=outliers,
        source="simulated",
        revision=identity,
        statistics=statistics(problem) | {"limit_deg": recipe.limit_deg},
    )


def _folded(truth: Floats, edges: Ints, measured: Floats, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Turn a third of the edges to the last third of the cameras by one rotation of the world; which those are (m,).

    They keep their noise.
    """
    part = np.arange(len(truth)) >= 2 * len(truth) // 3
    across = np.flatnonzero(part[edges[:, 0]] != part[edges[:, 1]])
    wrong = rng.choice(across, len(across) // 3, replace=False)
    turned = truth.copy()
    turned[part] = truth[part] @ so3.exp(np.radians(40.0) * so3.random_axes(rng, 1)[0])
    i, j = edges[wrong].T
    noise = truth[j] @ np.swapaxes(truth[i], -1, -2) @ measured[wrong]
    measured[wrong] = turned[i] @ np.swapaxes(turned[j], -1, -2) @ noise
    mask = np.zeros(len(edges), dtype=bool)
    mask[wrong] = True
    return mask


def _carried(
    recipe: Recipe,
    truth: Floats,
    edges: Ints,
    measured: Floats,
    outliers: NDArray[np.bool_],
    rng: np.random.Generator,
) -> dict[str, Any]:
    """What comes with the measurements, as arguments of `Problem`; `precisions` spreads the noise of the edges too."""
    m = len(edges)
    if recipe.carries == "counts":
        counts = np.where(outliers, rng.integers(16, 60, m), rng.integers(40, 400, m))
        return {"weights": counts.astype(float), "weights_kind": "count"}
    if recipe.carries == "precisions":
        sigmas = np.radians(recipe.noise_deg) * np.exp(rng.normal(0, 1, m))
        i, j = edges.T
        measured[:] = so3.exp(sigmas[:, None] * rng.standard_normal((m, 3))) @ truth[i] @ np.swapaxes(truth[j], -1, -2)
        return {"precisions": np.eye(3) / sigmas[:, None, None] ** 2}
    if recipe.carries == "gravity":
        tilt = so3.exp(np.radians(GRAVITY_DEG) * rng.standard_normal((len(truth), 3)))
        return {"gravity": tilt @ truth @ DOWN}
    return {}
