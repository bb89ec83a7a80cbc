"""Whether the order of methods depends on a choice that the reader did not make: the alignment, or the protocol."""

import itertools
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from bench.problem import Floats
from bench.scoring.statistics import FLOOR_DEG, RESOLUTION, Statistic, tie_groups

Key = TypeVar("Key", bound=Hashable)
Pair = tuple[Floats, Floats]


@dataclass(frozen=True)
class Reversal(Generic[Key]):
    """Two methods of which each is better, beyond a tie, under one of two choices.

    Parameters
    ----------
    first, second
        The methods.
    under, against
        `first` is the better one under the choice `under`, `second` under `against`.
    first_deg, second_deg
        Errors of the two methods, each under (`under`, `against`), degrees.
    """

    first: Key
    second: Key
    under: str
    against: str
    first_deg: tuple[float, float]
    second_deg: tuple[float, float]


def reversals(
    errors: Mapping[str, Mapping[Key, Floats]],
    statistic: Statistic = "median",
    *,
    same_cameras: bool = True,
    level: float = 0.05,
) -> list[Reversal[Key]]:
    """Pairs of methods whose order on one instance differs between choices, the largest change first.

    Every choice is judged on the cameras that both methods scored under it. A pair counts where the better one is
    told apart from the other (`bench.scoring.statistics.tie_groups`) under both choices; a mere change of
    sign between methods that are tied does not. Of several choices the two that favour each method most are named.

    Parameters
    ----------
    errors
        For each choice, such as ``l1`` and ``chordal``, and each method: (k,) or (s, k) errors in degrees of k
        cameras under s seeds, NaN where not scored. Choices may differ in their cameras.
    statistic
        What methods are ranked by.
    same_cameras, level
        As in `bench.scoring.statistics.tie_groups`. The level holds for each pair: as a false alarm takes two
        errors in opposite directions on nearly the same data, alarms are far rarer than that.
    """
    names = list(errors)
    methods = [key for key in errors[names[0]] if all(key in errors[name] for name in names)] if names else []
    found = []
    for a, b in itertools.combinations(methods, 2):
        pairs = [_common(errors[name][a], errors[name][b]) for name in names]
        scores = np.array([[_score(side, statistic) for side in pair] for pair in pairs])
        ahead = np.log(scores[:, 1] / scores[:, 0])  # how far a is better than b
        if not np.isfinite(ahead).all():
            continue
        most, least = int(np.argmax(ahead)), int(np.argmin(ahead))
        if ahead[most] <= RESOLUTION or ahead[least] >= -RESOLUTION:
            continue
        sides = zip((pairs[most], pairs[least]), ({0}, {1}), strict=True)
        if all(_winners(pair, statistic, same_cameras, level) == winner for pair, winner in sides):
            first, second = ((float(scores[most, k]), float(scores[least, k])) for k in (0, 1))
            size = float(min(ahead[most], -ahead[least]))
            found.append((size, Reversal(a, b, names[most], names[least], first, second)))
    return [reversal for _, reversal in sorted(found, key=lambda pair: -pair[0])]


def _common(left: Floats, right: Floats) -> Pair:
    """Both errors (s, k), NaN where either is; a method that ran once stands for every seed of the other."""
    a, b = np.broadcast_arrays(np.atleast_2d(left), np.atleast_2d(right))
    both = np.isfinite(a) & np.isfinite(b)
    return np.where(both, a, np.nan), np.where(both, b, np.nan)


def _score(errors: Floats, statistic: Statistic) -> float:
    """Geometric mean over the seeds of a statistic of errors (s, k); NaN where nothing is scored."""
    centre = np.median if statistic == "median" else np.mean
    seeds = [np.log(max(float(centre(row[np.isfinite(row)])), FLOOR_DEG)) for row in errors if np.isfinite(row).any()]
    return float(np.exp(np.mean(seeds))) if seeds else float("nan")


def _winners(pair: Pair, statistic: Statistic, same_cameras: bool, level: float) -> set[int]:
    return tie_groups(dict(enumerate(pair)), [statistic], same_cameras=same_cameras, level=level)
