"""Random graphs of which one part hangs on to the rest by consistently wrong measurements: a folded scene."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Instance, Ints, Problem, Source, dataset, parameter, so3, stream

from ._files.folders import revision
from ._simulated.graphs import connected_graph, pieces
from ._simulated.measurements import CODE, Measurements, OutlierModel
from ._simulated.noise import Noise
from ._simulated.statistics import statistics


@dataset("folded", title="Folded scenes", cite="tejus2023")
@dataclass(frozen=True)
class Folded:
    """A scene of which a part is turned as one piece by wrong measurements that agree with each other.

    What a repeated facade does to a scene: the pairs that are matched across are wrong all in the same way, so
    that the lowest cost is that of a folded scene. Absolute rotations are uniform, and the cameras of the part
    are a random subset. Pairs on one side are edges with probability 1 - `missing`, pairs across with `across`
    times that, drawn again until both sides and the whole are connected. Of the edges across, a fraction
    `agreeing`, rounded, measures R_i F R_j^T N_ij, where F is a rotation by `angle_deg` about a random axis of the
    world; i is the camera in the part. Noise and further outliers, on all edges, are those of ``erdos-renyi``.
    Every edge that is turned by F is an outlier, and known as such.

    Parameters
    ----------
    n
        Cameras.
    share
        Fraction of the cameras in the part, rounded.
    angle_deg
        Angle of F, degrees.
    agreeing
        Fraction of the edges across that are wrong, all in the same way. From about one half on, robust methods
        take them for the truth; least squares turns the part by something between.
    across
        Probability of an edge across, relative to that of one within.
    missing
        Expected fraction of the pairs within a side that are no edges.
    noise_deg, outliers, outlier_model, noise
        As in ``erdos-renyi``.
    """

    n: int = parameter(200, at_least=4)
    share: float = parameter(0.25, at_least=0, at_most=1)
    angle_deg: float = parameter(25.0, at_least=0, at_most=180)
    agreeing: float = parameter(0.7, at_least=0, at_most=1)
    across: float = parameter(0.2, at_least=0, at_most=1)
    missing: float = parameter(0.7, at_least=0, at_most=1)
    noise_deg: float = parameter(5.0, at_least=0, at_most=180)
    outliers: float = parameter(0.1, at_least=0, at_most=1)
    outlier_model: OutlierModel = "haar"
    noise: Noise = "paper"

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source]:
        """One instance for each seed."""
        identity = revision([Path(__file__), *CODE], repr(self), str(seed))
        yield Source(self._name(), identity, lambda: self._generate(seed, identity), seeded=True)

    def _generate(self, seed: int, identity: str) -> Instance:
        rng = stream(seed, "data", "folded")
        truth = so3.random(rng, self.n)
        part = np.zeros(self.n, dtype=bool)
        part[rng.choice(self.n, round(self.share * self.n), replace=False)] = True
        edges = self._connected_graph(part, rng)
        rotations, outliers = Measurements.of(self).simulate(truth, edges, rng)
        turned = truth.copy()
        turned[part] = truth[part] @ so3.exp(np.radians(self.angle_deg) * so3.random_axes(rng, 1)[0])
        candidates = np.flatnonzero(part[edges[:, 0]] != part[edges[:, 1]])
        wrong = rng.permutation(candidates)[: round(self.agreeing * len(candidates))]
        wrong = wrong[~outliers[wrong]]
        i, j = edges[wrong].T
        noise = _relative(truth, j, i) @ rotations[wrong]
        rotations[wrong] = _relative(turned, i, j) @ noise
        outliers[wrong] = True
        problem = Problem(self.n, edges, rotations)
        return Instance(
            problem,
            truth,
            name=self._name(),
            outliers=outliers,
            source=f"simulated: a part turned by {self.angle_deg:g} degrees; {self.noise} noise",
            revision=identity,
            statistics=statistics(problem),
        )

    def _connected_graph(self, part: NDArray[np.bool_], rng: np.random.Generator) -> Ints:
        """Edges (m, 2) of the first graph drawn of which both sides, one of them `part` (n,), and the whole connect."""
        i, j = np.triu_indices(self.n, 1)
        probability = (1 - self.missing) * np.where(part[i] == part[j], 1, self.across)

        def sides_connect(edges: Ints) -> bool:
            return pieces(edges[part[edges[:, 0]] == part[edges[:, 1]]], self.n) <= 2

        advice = "a smaller missing, or a larger across or n"
        return connected_graph(self.n, probability, rng, advice, sides_connect)

    def _name(self) -> str:
        """``n200-share0.25-angle25.0``, then every other parameter that is not at its default."""
        own = [f"{f.name}{getattr(self, f.name)}" for f in fields(self)[3:6] if getattr(self, f.name) != f.default]
        label = Measurements.of(self).label()
        return "-".join([f"n{self.n}", f"share{self.share}", f"angle{self.angle_deg}", *own, *label])


def _relative(rotations: Floats, i: Ints, j: Ints) -> Floats:
    """R_i R_j^T (k, 3, 3) for the pairs i, j (k,)."""
    return rotations[i] @ np.swapaxes(rotations[j], -1, -2)
