"""How many times faster one method is than another, from the rounds of a timing run."""

from collections.abc import Sequence
from statistics import median


def speedup(baseline_s: Sequence[float], own_s: Sequence[float]) -> tuple[float, float, float]:
    """Ratio of the medians, and the least and the greatest ratio of a round.

    The two methods took turns, so that a round of one is compared with the same round of the other, which ran
    within the same minutes of the machine. The range assumes nothing of how times are distributed.

    Parameters
    ----------
    baseline_s, own_s
        Seconds of the rounds, the same number of both.
    """
    ratios = [base / own for base, own in zip(baseline_s, own_s, strict=True)]
    return median(baseline_s) / median(own_s), min(ratios), max(ratios)
