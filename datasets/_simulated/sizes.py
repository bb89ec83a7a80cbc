"""How large the errors of edges are: log-normal, with another slope in the tail."""

from dataclasses import dataclass

import numpy as np

from bench import Floats

OUTLIER_DEG = 20.0  # an edge that is wrong by more counts as an outlier


@dataclass(frozen=True)
class Sizes:
    """Distribution of the angles by which edges are wrong, as a function of a latent quality of any distribution.

    The logarithm of the angle is piecewise linear in the quality, in units of its standard deviation: below the median
    with slope `spread`, from there to 20 degrees with the slope that makes the share of what is beyond exactly
    `outliers`, from there on with slope `tail`. What exceeds half a turn wraps around.

    Parameters
    ----------
    median_deg
        Above 0, below 20.
    outliers
        Below a half.
    spread, tail
        Slopes.
    """

    median_deg: float = 4.0
    outliers: float = 0.15
    spread: float = 1.6
    tail: float = 1.7

    def __post_init__(self) -> None:
        if not 0 < self.median_deg < OUTLIER_DEG:
            raise ValueError(f"a median error of {self.median_deg} degrees is not above 0 and below {OUTLIER_DEG:g}")
        if not 0 <= self.outliers < 0.5:
            raise ValueError(f"a share of {self.outliers} outliers is not below a half")

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "Sizes":
        """From ranges about twice as wide as what Madrid Metropolis and Union Square show."""
        logarithm, *others = rng.uniform([np.log(1.5), 0.04, 1.1, 1.2], [np.log(8.0), 0.35, 1.9, 2.2]).tolist()
        return cls(float(np.exp(logarithm)), *others)

    def of(self, quality: Floats) -> Floats:
        """Angles (m,), radians, not yet wrapped, of edges of a quality (m,) that grows with the error."""
        middle, knee = np.quantile(quality, [0.5, 1 - self.outliers])
        unit = quality.std() or 1.0
        rise = np.log(OUTLIER_DEG / self.median_deg)
        below = self.spread * np.minimum(quality - middle, 0) / unit
        between = rise * np.clip((quality - middle) / (knee - middle or 1.0), 0, 1)
        beyond = self.tail * np.maximum(quality - knee, 0) / unit
        return np.asarray(np.radians(self.median_deg) * np.exp(below + between + beyond))
