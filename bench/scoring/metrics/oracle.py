"""Errors along the checkpoints of an estimate, and the pick that only ground truth can make."""

from dataclasses import dataclass

import numpy as np

from bench.core.problem import Estimate, Floats
from bench.scoring.metrics.errors import camera_errors

ORACLE = "oracle"


@dataclass(frozen=True, eq=False)
class Curve:
    """Errors of one estimate at each of its k checkpoints.

    Parameters
    ----------
    iterations, seconds
        (k,) when.
    errors
        (k, n) per-camera errors in degrees, NaN where not scored.
    """

    iterations: Floats
    seconds: Floats
    errors: Floats

    @property
    def mean_deg(self) -> Floats:
        """(k,) mean error over the scored cameras."""
        mean: Floats = np.nanmean(self.errors, axis=1)
        return mean

    @property
    def oracle(self) -> int:
        """The checkpoint with the smallest mean error, which is how the figures of DMF-Synch were picked.

        No method can make this choice, because it takes the ground truth; whatever is shown of it is labelled
        `ORACLE`.
        """
        return int(np.argmin(self.mean_deg))


def curve(estimate: Estimate, truth: Floats, rule: str = "l1") -> Curve | None:
    """Errors at every checkpoint; None where there are no checkpoints, or no camera to score.

    Parameters
    ----------
    estimate
        With or without checkpoints.
    truth
        (n, 3, 3), NaN where unknown.
    rule
        One of `bench.scoring.metrics.alignment.RULES`.
    """
    errors = np.array([camera_errors(c.rotations, truth, rule) for c in estimate.checkpoints])
    if not np.isfinite(errors).any():
        return None
    iterations = np.array([c.iteration for c in estimate.checkpoints], dtype=float)
    return Curve(iterations, np.array([c.seconds for c in estimate.checkpoints]), errors)
