"""Simulated measurements on the edges of a graph: noise on all, and outliers in place of some."""

import inspect
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints, so3, stream

from . import graphs
from . import noise as noise_models
from .noise import Noise

OutlierModel = Literal["haar", "authors"]

# The files that decide what is simulated; part of the revision of every simulated instance.
_FILES = (__file__, graphs.__file__, noise_models.__file__, so3.__file__, inspect.getfile(stream))
CODE = tuple(Path(str(file)) for file in _FILES)


@dataclass(frozen=True)
class Measurements:
    """How relative rotations are measured; the parameters that simulated datasets share.

    Parameters
    ----------
    noise_deg, noise
        Scale and model of the noise on the inliers; see `noise.sample`.
    outliers
        Fraction of the edges; their number is exactly this times m, rounded.
    outlier_model
        ``haar``: uniform rotations. ``authors``: the rotation nearest to a matrix with entries uniform on
        [0, 1], as in the code of Tejus et al. (2023), which is biased towards one part of SO(3).
    """

    noise_deg: float = 5.0
    outliers: float = 0.4
    outlier_model: OutlierModel = "haar"
    noise: Noise = "paper"

    @classmethod
    def of(cls, dataset: object) -> "Measurements":
        """Those of a dataset that has parameters of the same names."""
        return cls(**{field.name: getattr(dataset, field.name) for field in fields(cls)})

    def simulate(self, truth: Floats, edges: Ints, rng: np.random.Generator) -> tuple[Floats, NDArray[np.bool_]]:
        """Measure R_i R_j^T N_ij on every edge, then replace the outliers.

        Parameters
        ----------
        truth
            (n, 3, 3) absolute rotations.
        edges
            (m, 2).

        Returns
        -------
        tuple
            Measured rotations (m, 3, 3), and the mask (m,) of the outliers.
        """
        m = len(edges)
        i, j = edges.T
        noise = noise_models.sample(self.noise, self.noise_deg, rng, m)
        rotations = truth[i] @ np.swapaxes(truth[j], -1, -2) @ noise
        outliers = np.zeros(m, dtype=bool)
        outliers[rng.choice(m, round(self.outliers * m), replace=False)] = True
        rotations[outliers] = self._outlying(rng, int(outliers.sum()))
        return rotations, outliers

    def label(self) -> list[str]:
        """What names an instance: every parameter that is not at its default."""
        parts = {
            "noise_deg": f"noise{self.noise_deg}",
            "outliers": f"outliers{self.outliers}",
            "outlier_model": f"{self.outlier_model}-outliers",
            "noise": f"{self.noise}-noise",
        }
        return [parts[field.name] for field in fields(self) if getattr(self, field.name) != field.default]

    def _outlying(self, rng: np.random.Generator, count: int) -> Floats:
        """Rotations (count, 3, 3) in place of measurements."""
        if self.outlier_model == "authors":
            return so3.project(rng.random((count, 3, 3)))
        return so3.random(rng, count)
