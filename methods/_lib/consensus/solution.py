"""Where consensus ends."""

from dataclasses import dataclass

from bench import Floats

from ..descent.descent import Descent
from .efficiency import Fit
from .recombination import Judge
from .settling import Settling


@dataclass(frozen=True, eq=False)
class Solution:
    """Cameras at rest, with what is known there.

    Parameters
    ----------
    settling, judge
        Of this problem.
    descent
        At the solution.
    fit
        The loss that it is settled with.
    noise
        The noise scale, radians.
    note
        How it came about, in words.
    """

    settling: Settling
    judge: Judge
    descent: Descent
    fit: Fit
    noise: float
    note: str

    def weights(self, angles: Floats) -> Floats:
        """(m,) of the edges, by that loss, for residuals (m,) in radians."""
        return self.settling.weights(angles, self.fit.scales, self.fit.power)
