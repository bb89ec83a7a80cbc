"""Random graphs with noise and outliers, as in section IV-A of the founding paper."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench import Instance, Problem, Source, dataset, parameter, so3, stream

from ._files.folders import revision
from ._simulated.graphs import connected_graph
from ._simulated.measurements import CODE, Measurements, OutlierModel
from ._simulated.noise import Noise
from ._simulated.statistics import statistics

_MOST_CAMERAS = 30_000  # every pair is drawn; this many take 7 GiB


@dataset("erdos-renyi", title="Erdős–Rényi", cite="tejus2023")
@dataclass(frozen=True)
class ErdosRenyi:
    """A connected Erdős–Rényi graph with noise on its edges and a fraction of outliers.

    Tejus et al. (2023), section IV-A. Absolute rotations come from Euler angles; every pair is an edge with
    probability 1 - `missing`, drawn again until the graph is connected; a fraction of the edges are
    outliers; the others are R_ij N_ij, where N_ij has a random axis and an angle from N(0, `noise_deg`).

    What the text leaves open is settled here as follows. Euler angles are uniform on [-180, 180) degrees
    (the authors' code draws them from N(0, 1) radians). The number of outliers is exactly `outliers` times
    m, rounded. Axes are uniform on the sphere (their code: in a cube, then normalised). An outlier is a
    Haar-uniform rotation in place of the measured one. Only the whole graph must be connected (their code
    asks it of the inliers too). Where text and code differ the text stands: their code draws angles from
    N(`noise_deg`, 1), never near zero.

    Parameters
    ----------
    n
        Cameras.
    missing
        Expected fraction of the pairs without an edge, 1 - p.
    noise_deg
        Scale of the noise: for ``paper`` the standard deviation of its angle, for the others that of each
        component of its rotation vector, degrees.
    outliers
        Fraction of the edges.
    outlier_model
        ``haar``, or ``authors``: the rotation nearest to a matrix with entries uniform on [0, 1], as in
        their code, which is biased towards one part of SO(3).
    noise
        ``paper``, or one of two models for which a Cramér-Rao bound exists: ``tangent`` (a Gaussian rotation
        vector) and ``langevin``; the formulas are in ``_simulated/noise.py``.
    clairvoyant
        Leave out the edges that are outliers, which only the truth can tell: the same graph and the same
        measurements otherwise, so that errors on it say what is lost by having to find the outliers. What is
        left need not be connected.
    """

    n: int = parameter(100, at_least=2, at_most=_MOST_CAMERAS)
    missing: float = parameter(0.5, at_least=0, below=1)
    noise_deg: float = parameter(5.0, at_least=0, at_most=180)
    outliers: float = parameter(0.4, at_least=0, at_most=1)
    outlier_model: OutlierModel = "haar"
    noise: Noise = "paper"
    clairvoyant: bool = False

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source]:
        """One instance for each seed."""
        identity = revision([Path(__file__), *CODE], repr(self), str(seed))
        yield Source(self._name(), identity, lambda: self._generate(seed, identity), seeded=True)

    def _generate(self, seed: int, identity: str) -> Instance:
        rng = stream(seed, "data", "erdos-renyi")
        truth = so3.from_euler(rng.uniform(-np.pi, np.pi, (self.n, 3)))
        edges = connected_graph(self.n, 1 - self.missing, rng, "a smaller missing or a larger n")
        rotations, outliers = Measurements.of(self).simulate(truth, edges, rng)
        if self.clairvoyant:
            edges, rotations, outliers = edges[~outliers], rotations[~outliers], outliers[~outliers]
        problem = Problem(self.n, edges, rotations)
        return Instance(
            problem,
            truth,
            name=self._name(),
            outliers=outliers,
            source=f"simulated: Tejus et al. 2023, section IV-A; {self.noise} noise",
            revision=identity,
            notes=("the true outliers are left out, which no method can know",) if self.clairvoyant else (),
            statistics=statistics(problem),
        )

    def _name(self) -> str:
        """``n100-missing0.5``, then every other parameter that is not at its default."""
        parts = [f"n{self.n}", f"missing{self.missing}", *Measurements.of(self).label()]
        return "-".join([*parts, "clairvoyant"] if self.clairvoyant else parts)
