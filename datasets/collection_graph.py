"""View graphs like pieces of photo collections, made from nothing, with correlated errors."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bench import Instance, Problem, Source, dataset, parameter, stream

from ._files.folders import revision
from ._simulated import correlated, crowds
from ._simulated.correlated import Law
from ._simulated.crowds import Crowd, drawn_degree
from ._simulated.statistics import statistics


@dataset("collection-graph", title="Photo collections, simulated view graphs", cite="wilson2014")
@dataclass(frozen=True)
class CollectionGraph:
    """Dense graphs of who sees the same among a crowd at popular sights; errors are correlated.

    Cameras stand in clusters before sights along a front that may turn, and differ in zoom, direction and in how good
    the photograph is; the pairs that match best are edges. The formulas are in ``_simulated/crowds.py``. Cameras and
    errors follow the law of ``view-graph[noise=correlated]``. Every parameter that is not given here is drawn for each
    seed, of the topology as of the law. Unlike ``street-graph`` it is meant for the size and density of the pieces that
    networks are trained on, and its cost is quadratic in the cameras.

    Ranges were set on pieces of 60, 100 and 200 cameras, as of ``view-graph[cameras=100]``, of twelve view graphs:
    Quad, and all of 1DSfM at hand but Ellis Island, Madrid Metropolis, NYC Library and Piazza del Popolo. Degrees,
    clustering coefficients, eigenvalues and overlaps of neighbourhoods differ from those of pieces of equal size and
    density about as much as pieces of two scenes do: ``tests/tools/topologies.py``, ``results/reference/calibration``.

    Parameters
    ----------
    n
        Cameras.
    degree
        Mean number of edges at a camera; by default drawn, such that the densities of real pieces are covered: half of
        the graphs with 100 cameras have 49 to 87.
    noise_deg
        Median error of an edge; by default drawn.
    outliers
        Fraction of the edges that are wrong by more than 20 degrees, to which a fold adds its own; by default drawn.
    """

    n: int = parameter(200, at_least=2, at_most=3000)
    degree: float | None = parameter(None, at_least=2)
    noise_deg: float | None = parameter(None, above=0, below=20)
    outliers: float | None = parameter(None, at_least=0, below=0.5)

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source]:
        """One instance for each seed."""
        identity = revision([Path(__file__), Path(str(crowds.__file__)), *correlated.CODE], repr(self), str(seed))
        yield Source(self._name(), identity, lambda: self._generate(seed, identity), seeded=True)

    def _generate(self, seed: int, identity: str) -> Instance:
        rng = stream(seed, "data", "collection-graph", str(self.n))
        degree = drawn_degree(self.n, rng) if self.degree is None else self.degree
        edges = Crowd.drawn(rng).edges(self.n, degree, rng)
        law = Law.drawn(rng, self.noise_deg, self.outliers)
        truth, rotations, outliers = law.simulate(self.n, edges, rng)
        problem = Problem(self.n, edges, rotations)
        return Instance(
            problem,
            truth,
            name=self._name(),
            outliers=outliers,
            source="simulated: a photo collection's view graph, correlated errors",
            revision=identity,
            notes=(correlated.INFORMED, "topologies are drawn to resemble those of twelve other scenes of 1DSfM"),
            statistics=statistics(problem),
        )

    def _name(self) -> str:
        """``collection-n200``, then what was given."""
        given = {"degree": self.degree, "noise": self.noise_deg, "outliers": self.outliers}
        told = [f"{key}{value}" for key, value in given.items() if value is not None]
        return "-".join(["collection", f"n{self.n}", *told])
