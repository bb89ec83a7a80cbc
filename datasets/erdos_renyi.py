"""Random graphs with noise and outliers, as in section IV-A of the founding paper."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from bench import seeds, so3
from bench.errors import InputError
from bench.problem import Floats, Instance, Ints, Problem
from bench.registry import Source, dataset

from . import _statistics

_ATTEMPTS = 1000


@dataset("erdos-renyi", title="Erdős–Rényi", cite="tejus2023")
@dataclass(frozen=True)
class ErdosRenyi:
    """A connected Erdős–Rényi graph with Gaussian noise on its edges and a fraction of outliers.

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
        Standard deviation of the noise angle, degrees.
    outliers
        Fraction of the edges.
    outlier_model
        ``haar``, or ``authors``: the rotation nearest to a matrix with entries uniform on [0, 1], as in
        their code, which is biased towards one part of SO(3).
    clairvoyant
        Leave out the edges that are outliers, which only the truth can tell: the same graph and the same
        measurements otherwise, so that errors on it say what is lost by having to find the outliers. What is
        left need not be connected.
    """

    n: int = 100
    missing: float = 0.5
    noise_deg: float = 5.0
    outliers: float = 0.4
    outlier_model: Literal["haar", "authors"] = "haar"
    clairvoyant: bool = False

    def __post_init__(self) -> None:
        if self.n < 2:
            raise ValueError(f"n must be at least 2, not {self.n}")
        if not 0 <= self.missing < 1:
            raise ValueError(f"missing must be at least 0 and below 1, not {self.missing}")
        if not 0 <= self.noise_deg <= 180:
            raise ValueError(f"noise_deg must be from 0 to 180, not {self.noise_deg}")
        if not 0 <= self.outliers <= 1:
            raise ValueError(f"outliers must be from 0 to 1, not {self.outliers}")

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source]:
        """One instance for each seed."""
        identity = self._revision(seed)
        yield Source(self._name(), identity, lambda: self._generate(seed, identity), seeded=True)

    def _generate(self, seed: int, identity: str) -> Instance:
        rng = seeds.stream(seed, "data", "erdos-renyi")
        truth = so3.from_euler(rng.uniform(-np.pi, np.pi, (self.n, 3)))
        edges = self._connected_graph(rng)
        m = len(edges)
        i, j = edges.T
        angles = np.radians(self.noise_deg) * rng.standard_normal((m, 1))
        noise = so3.exp(angles * so3.random_axes(rng, m))
        rotations = truth[i] @ np.swapaxes(truth[j], -1, -2) @ noise
        outliers = np.zeros(m, dtype=bool)
        outliers[rng.choice(m, round(self.outliers * m), replace=False)] = True
        rotations[outliers] = self._outlying(rng, int(outliers.sum()))
        if self.clairvoyant:
            edges, rotations, outliers = edges[~outliers], rotations[~outliers], outliers[~outliers]
        problem = Problem(self.n, edges, rotations)
        return Instance(
            problem,
            truth,
            name=self._name(),
            outliers=outliers,
            source="simulated: Tejus et al. 2023, section IV-A",
            revision=identity,
            notes=("the true outliers are left out, which no method can know",) if self.clairvoyant else (),
            statistics=_statistics.statistics(problem),
        )

    def _connected_graph(self, rng: np.random.Generator) -> Ints:
        """Edges (m, 2) of the first connected graph drawn."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        i, j = np.triu_indices(self.n, 1)
        for _ in range(_ATTEMPTS):
            kept = rng.random(len(i)) < 1 - self.missing
            graph = coo_array((np.ones(kept.sum()), (i[kept], j[kept])), shape=(self.n, self.n))
            if connected_components(graph, directed=False, return_labels=False) == 1:
                return np.stack([i[kept], j[kept]], axis=1).astype(np.int32)
        raise InputError(
            f"erdos-renyi: none of {_ATTEMPTS} random graphs with n={self.n} and missing={self.missing} is "
            "connected; choose a smaller missing or a larger n"
        )

    def _outlying(self, rng: np.random.Generator, count: int) -> Floats:
        if self.outlier_model == "authors":
            return so3.project(rng.random((count, 3, 3)))
        return so3.random(rng, count)

    def _name(self) -> str:
        """``n100-missing0.5``, then every other parameter that is not at its default."""
        parts = [f"n{self.n}", f"missing{self.missing}"]
        if self.noise_deg != ErdosRenyi.noise_deg:
            parts.append(f"noise{self.noise_deg}")
        if self.outliers != ErdosRenyi.outliers:
            parts.append(f"outliers{self.outliers}")
        if self.outlier_model != ErdosRenyi.outlier_model:
            parts.append(f"{self.outlier_model}-outliers")
        if self.clairvoyant:
            parts.append("clairvoyant")
        return "-".join(parts)

    def _revision(self, seed: int) -> str:
        """Hash of the code that generates, the parameters and the seed."""
        digest = hashlib.sha256(f"{self!r} {seed}".encode())
        for source in (__file__, so3.__file__, seeds.__file__):
            digest.update(Path(source).read_bytes())
        return digest.hexdigest()
