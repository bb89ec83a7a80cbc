"""Which features of two pictures are matched, rightly and wrongly."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench import Floats

from .points import Points
from .views import View

_REPEATABLE = 0.9  # share of the features in both pictures that match where nothing else is against it
_ANGLE = np.radians(45)  # between two lines of sight at which matches have fallen to 1/e
_APART = 0.15  # how fast they fall with the difference in conditions
_MOST = 400  # right matches, for time
_TEXTURE = 0.5  # share of the pairs whose wrong matches are between two spots, such as foliage or paving
_LEAST_PART, _LARGEST_PART = 0.1, 0.6  # share of the matches that a one-sided pair keeps


@dataclass(frozen=True, eq=False)
class Matches:
    """Matched features of two pictures.

    Parameters
    ----------
    first, second
        (k, 2) pixels.
    right
        (k,) whether both are one feature of the place.
    copied
        (k,) whether one is a repetition of the other.
    """

    first: Floats
    second: Floats
    right: NDArray[np.bool_]
    copied: NDArray[np.bool_]


@dataclass(frozen=True)
class Matcher:
    """How features are matched.

    Parameters
    ----------
    mismatches
        Mean number of wrong matches of a pair.
    one_sided
        Share of the pairs that match in a part of the picture only.
    """

    mismatches: float
    one_sided: float

    def match(self, one: View, two: View, conditions: float, points: Points, rng: np.random.Generator) -> Matches:
        """Matches of two pictures whose conditions differ by `conditions`.

        A feature that both found matches with probability 0.9 exp(-(angle / 45 degrees)^2 - 0.15 conditions^2);
        a repetition is matched as if seen from the same side. Wrong matches are log-normal in number, at features
        of any place or around one feature of each picture.
        """
        _, i, j = np.intersect1d(one.looks, two.looks, assume_unique=True, return_indices=True)
        copied = one.ids[i] != two.ids[j]
        angle = np.arccos(np.clip(np.einsum("ij,ij->i", one.rays[i], two.rays[j]), -1, 1))
        relative = np.where(copied, 0.0, angle / _ANGLE)
        kept = rng.random(len(i)) < _REPEATABLE * np.exp(-(relative**2) - _APART * conditions**2)
        if rng.random() < self.one_sided:
            view, which = (one, i) if rng.random() < 0.5 else (two, j)
            kept[kept] = _one_part(view.pixels[which[kept]], view.spot, rng)
        chosen = rng.permutation(np.flatnonzero(kept))[:_MOST]
        count = int(self.mismatches * np.exp(rng.standard_normal() - 0.5))
        together = rng.random() < _TEXTURE
        wrong = [_somewhere(view.pixels, count, together, rng) for view in (one, two)]
        few = min(map(len, wrong))
        i, j = np.concatenate([i[chosen], wrong[0][:few]]), np.concatenate([j[chosen], wrong[1][:few]])
        right = one.ids[i] == two.ids[j]
        return Matches(one.pixels[i], two.pixels[j], right, ~right & (one.looks[i] == two.looks[j]))


def _one_part(pixels: Floats, spot: Floats, rng: np.random.Generator) -> NDArray[np.bool_]:
    """(k,) a share of what is at pixels (k, 2), around a spot (2,)."""
    distance = np.sum((pixels - spot) ** 2, axis=1)
    return np.argsort(np.argsort(distance)) < rng.uniform(_LEAST_PART, _LARGEST_PART) * len(pixels)


def _somewhere(pixels: Floats, count: int, together: bool, rng: np.random.Generator) -> NDArray[np.int64]:
    """At most `count` features of a picture with pixels (k, 2), around one of them where they are `together`."""
    count = min(count, len(pixels))
    if not together or count == 0:
        return rng.choice(len(pixels), count, replace=False)
    middle = pixels[rng.integers(len(pixels))]
    distance = np.sum((pixels - middle) ** 2, axis=1) * rng.exponential(1.0, len(pixels))
    return rng.permutation(np.argsort(distance)[:count])
