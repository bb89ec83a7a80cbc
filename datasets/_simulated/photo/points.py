"""The features of a place: where they are, how large, and which look like others."""

from dataclasses import dataclass

import numpy as np

from bench import Floats, Ints

from .surfaces import Surface

_SMALLEST = 0.4  # size of the least feature, relative to what a typical camera resolves
_LARGEST = 16.0  # the same of the largest
_PER_CLUSTER = 25
_SPREAD = 0.06  # standard deviation of a cluster, relative to the sides of its surface
_STANDING_OUT = 0.5  # share of the clusters
_ROUGHNESS = 0.05  # of a cluster, relative to the relief of its surface


@dataclass(frozen=True, eq=False)
class Points:
    """Features of a place.

    Parameters
    ----------
    positions, normals
        (k, 3) in metres.
    sizes
        (k,) metres.
    looks
        (k,) features with one look are taken for each other.
    copies
        (k,) 0 for a feature that is itself, else the number, from 1, of the repetition that made it.
    """

    positions: Floats
    normals: Floats
    sizes: Floats
    looks: Ints
    copies: Ints


def scatter(
    surfaces: list[Surface],
    repetitions: list[tuple[int, int]],
    repeated: float,
    count: int,
    resolved: float,
    rng: np.random.Generator,
) -> Points:
    """Features on surfaces, of which some repeat others.

    Parameters
    ----------
    surfaces
        Of the place.
    repetitions
        Pairs (source, target) of surfaces, of which the second repeats the first.
    repeated
        Share of the features of each target that are those of its source, at the same places of the surface.
    count
        Features in all, up to rounding.
    resolved
        Metres: size of what a typical camera resolves.
    """
    area = np.array([surface.sides.prod() * surface.density for surface in surfaces])
    counts = np.maximum(_PER_CLUSTER, np.round(count * area / area.sum())).astype(int)
    ends = np.cumsum(counts)
    looks = [np.arange(end - k, end) for end, k in zip(ends, counts, strict=True)]
    copies = [np.zeros(k, dtype=int) for k in counts]
    local = [_on_one(surface, k, resolved, rng) for surface, k in zip(surfaces, counts, strict=True)]
    for number, (source, target) in enumerate(repetitions, 1):
        both = int(min(counts[source], counts[target]))
        which = rng.permutation(both)[: round(repeated * both)]
        local[target][which], looks[target][which], copies[target][which] = (
            local[source][which],
            looks[source][which],
            number,
        )
    return Points(
        np.concatenate([s.corner + x[:, :3] @ s.frame.T for s, x in zip(surfaces, local, strict=True)]),
        np.repeat([s.frame[:, 2] for s in surfaces], counts, axis=0),
        np.concatenate([x[:, 3] for x in local]),
        np.concatenate(looks),
        np.concatenate(copies),
    )


def _on_one(surface: Surface, count: int, resolved: float, rng: np.random.Generator) -> Floats:
    """(count, 4): place along both sides and the normal, and size; metres.

    Clusters have uniform centres, log-normal shares, and half of them stand out by an exponential depth. Sizes s
    have the density s^-3 of scale space: as many features on every level of an image pyramid, relative to its area.
    """
    clusters = max(3, count // _PER_CLUSTER)
    share = np.exp(rng.standard_normal(clusters))
    cluster = rng.choice(clusters, count, p=share / share.sum())
    place = np.abs(rng.random((clusters, 2))[cluster] + _SPREAD * rng.standard_normal((count, 2)))
    place = np.where(place > 1, 2 - place, place) * surface.sides
    out = rng.exponential(surface.relief, clusters) * (rng.random(clusters) < _STANDING_OUT)
    depth = out[cluster] + _ROUGHNESS * surface.relief * rng.standard_normal(count)
    beyond = rng.random(count) * (1 - (_SMALLEST / _LARGEST) ** 2)
    return np.column_stack([place, depth, _SMALLEST * resolved / np.sqrt(1 - beyond)])
