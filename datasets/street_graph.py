"""View graphs of streets and squares, made from nothing, with correlated errors."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bench import Instance, Problem, Source, dataset, parameter, stream

from ._files.folders import revision
from ._simulated import correlated, streets
from ._simulated.correlated import Law
from ._simulated.statistics import statistics
from ._simulated.streets import Street


@dataset("street-graph", title="Streets and squares, simulated", cite="wilson2014")
@dataclass(frozen=True)
class StreetGraph:
    """Photographs along a street or around a square: who sees the same is an edge; errors are correlated.

    Degrees relative to their mean, and how often two neighbours of a camera are neighbours, are like those of the view
    graphs of 1DSfM: dense places, and many photographs with few edges. Cameras and errors follow the law of
    ``view-graph[noise=correlated]``, of which every parameter that is not given is drawn for each seed. The cost is
    linear in the edges, so that a million cameras can be had.

    Parameters
    ----------
    n
        Cameras.
    degree
        Mean number of edges at a camera, up to sampling.
    layout
        ``street``: cameras along a line. ``square``: around one, so that the graph closes.
    noise_deg
        Median error of an edge; by default drawn.
    outliers
        Fraction of the edges that are wrong by more than 20 degrees, to which a fold adds its own; by default drawn.
    """

    n: int = parameter(300, at_least=2)
    degree: float = parameter(60.0, at_least=2)
    layout: Literal["street", "square"] = "street"
    noise_deg: float | None = parameter(None, above=0, below=20)
    outliers: float | None = parameter(None, at_least=0, below=0.5)

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source]:
        """One instance for each seed."""
        identity = revision([Path(__file__), Path(str(streets.__file__)), *correlated.CODE], repr(self), str(seed))
        yield Source(self._name(), identity, lambda: self._generate(seed, identity), seeded=True)

    def _generate(self, seed: int, identity: str) -> Instance:
        rng = stream(seed, "data", "street-graph")
        edges = Street.drawn(min(self.degree, self.n - 1), self.layout == "square", rng).edges(self.n, rng)
        law = Law.drawn(rng, self.noise_deg, self.outliers)
        truth, rotations, outliers = law.simulate(self.n, edges, rng)
        problem = Problem(self.n, edges, rotations)
        return Instance(
            problem,
            truth,
            name=self._name(),
            outliers=outliers,
            source=f"simulated: a {self.layout}, correlated errors",
            revision=identity,
            statistics=statistics(problem),
        )

    def _name(self) -> str:
        """``street-n300-degree60``, then what was given of the law."""
        given = {"noise": self.noise_deg, "outliers": self.outliers}
        told = [f"{key}{value}" for key, value in given.items() if value is not None]
        return "-".join([self.layout, f"n{self.n}", f"degree{self.degree:g}", *told])
