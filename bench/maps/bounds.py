"""What theory says of a phase map: limits that no method, or none of a kind, gets past."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.core.errors import InputError
from bench.core.problem import Floats, Instance, Problem
from bench.maps.criterion import clairvoyant_median_deg

Drawn = tuple[tuple[int, int], Mapping[str, Any], Iterable[Instance]]


@dataclass(frozen=True, eq=False)
class Limits:
    """Quantities of the problems themselves, averaged over the seeds of each cell, all (nx, ny).

    Parameters
    ----------
    connected
        Share of the problems whose inliers connect all cameras. Below one half most problems have no answer,
        whatever the noise.
    clairvoyant_deg
        Median error of an efficient estimator that knows the outliers, in degrees; NaN where no problem of the
        cell has one, and None for noise without a bound.
    detection
        Inlier share times the square root of the mean degree. On random graphs with many cameras the leading
        eigenvectors carry nothing of the truth below one: 3n x 3n noise of block variance d / 3 has its edge at
        2 sqrt(d), and the eigenvalue of the signal, q d, leaves it at q sqrt(d) = 1 (Singer 2011, for angles; Baik,
        Ben Arous and Péché's transition). It speaks of eigenvectors, of small noise, and of n to infinity.
    """

    connected: Floats
    clairvoyant_deg: Floats | None
    detection: Floats


def limits(shape: tuple[int, int], cells: Iterable[Drawn], tell: Callable[[str], None] = lambda _: None) -> Limits:
    """Compute the limits on the very problems of a map.

    Parameters
    ----------
    shape
        Of the grid.
    cells
        For each cell its place, the complete parameters of its dataset and its instances.
    tell
        Is told, once, why there is no clairvoyant line.
    """
    connected, clairvoyant, detection = (np.full(shape, np.nan) for _ in range(3))
    bounded = True
    for place, parameters, instances in cells:
        drawn = list(instances)
        parts = [inliers_of(instance) for instance in drawn]
        connected[place] = np.mean([not part.components.any() for part in parts])
        ratios = [part.m / i.problem.m * np.sqrt(i.problem.degree.mean()) for part, i in zip(parts, drawn, strict=True)]
        detection[place] = np.mean(ratios)
        if bounded:
            try:
                found = np.array([clairvoyant_median_deg(instance, parameters) for instance in drawn])
            except InputError as error:
                tell(f"no clairvoyant line: {error}")
                bounded = False
            else:
                clairvoyant[place] = found[np.isfinite(found)].mean() if np.isfinite(found).any() else np.nan
    return Limits(connected, clairvoyant if bounded else None, detection)


def inliers_of(instance: Instance) -> Problem:
    """The problem without its outliers."""
    problem = instance.problem
    if instance.outliers is None:
        return problem
    return Problem(problem.n, problem.edges[~instance.outliers], problem.rotations[~instance.outliers])
