"""Performance profiles (Dolan and More, Mathematical Programming 91, 2002)."""

from dataclasses import dataclass

import numpy as np

from bench.core.problem import Floats
from bench.scoring.inference.blocks import Blocks, Configured


@dataclass(frozen=True, eq=False)
class Profile:
    """Of one method: on which share of the problems it is within a factor of the best method.

    Parameters
    ----------
    method
        The configured method.
    ratios
        (j,) from 1 upwards, where the share changes.
    shares
        (j,) share of the problems, in [0, 1], at each ratio and until the next. Its first entry is the share of the
        problems on which the method is the best; the last stays below 1 where it failed on some.
    """

    method: Configured
    ratios: Floats
    shares: Floats


def performance_profiles(blocks: Blocks) -> list[Profile]:
    """Profiles of all methods; a method that failed on a problem is within no factor of the best there.

    Read the left edge as wins and the right as robustness; which of two methods lies above the other in between can
    change with the others that take part (Gould and Scott, ACM TOMS 43, 2016).
    """
    ratios = blocks.values / blocks.values.min(axis=1, keepdims=True)
    return [_profile(method, own) for method, own in zip(blocks.methods, ratios.T, strict=True)]


def _profile(method: Configured, ratios: Floats) -> Profile:
    steps, counts = np.unique(ratios[np.isfinite(ratios)], return_counts=True)
    if not len(steps) or steps[0] > 1:
        steps, counts = np.concatenate([[1.0], steps]), np.concatenate([[0], counts])
    return Profile(method, steps, np.cumsum(counts) / len(ratios))
