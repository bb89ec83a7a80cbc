"""What counts as success in a cell of a phase map."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.core.errors import InputError
from bench.core.problem import Floats, Instance
from bench.scoring.metrics.theory import efficient_median_deg, information


@dataclass(frozen=True)
class Criterion:
    """Success is a median error below a bound.

    Parameters
    ----------
    value
        The bound in degrees; or, where `relative`, as a multiple of the median error of an efficient estimator that
        knows the outliers of the instance (`bench.scoring.metrics.theory.efficient_median_deg`).
    relative
        Which of the two.
    """

    value: float
    relative: bool = False

    def __str__(self) -> str:
        """As a figure says it."""
        bound = f"{self.value:g} times the clairvoyant efficient one" if self.relative else f"{self.value:g}°"
        return f"median error below {bound}"

    def check(self, parameters: Mapping[str, Any]) -> None:
        """Raise InputError where a relative bound is asked of noise that has none."""
        if self.relative:
            information(*noise_of(parameters))

    def met(self, median_deg: float, instance: Instance, parameters: Mapping[str, Any]) -> bool:
        """Whether a median error is a success; never where a relative bound has no value (inliers not connected)."""
        bound = self.value * clairvoyant_median_deg(instance, parameters) if self.relative else self.value
        return bool(median_deg < bound)


def parse_criterion(text: str) -> Criterion:
    """Read ``3`` or ``3deg`` (degrees), or ``2x`` (times the clairvoyant efficient error).

    Raises
    ------
    InputError
        Where it is neither, or not above zero.
    """
    found = re.fullmatch(r"\s*(\d*\.?\d+)\s*(deg|°|x)?\s*", text)
    if not found or float(found[1]) <= 0:
        raise InputError(f"--success must be degrees, such as 5, or a multiple, such as 2x, not '{text}'")
    return Criterion(float(found[1]), found[2] == "x")


def median_of_all(errors: Floats) -> float:
    """Median error over all cameras with a truth; one that was not solved is as wrong as can be.

    Parameters
    ----------
    errors
        Errors (n,) in degrees of the cameras whose truth is known, NaN where not solved.
    """
    return float(np.median(np.where(np.isnan(errors), np.inf, errors)))


def noise_of(parameters: Mapping[str, Any]) -> tuple[str, float]:
    """Noise model and its scale in degrees, from the complete parameters of a dataset.

    Raises
    ------
    InputError
        Where the dataset has no such parameters.
    """
    try:
        return parameters["noise"], parameters["noise_deg"]
    except KeyError as error:
        raise InputError(f"the dataset has no parameter {error}, so there is no bound to be a multiple of") from error


def clairvoyant_median_deg(instance: Instance, parameters: Mapping[str, Any]) -> float:
    """Median error of an efficient estimator that knows the outliers; NaN where the inliers are not connected."""
    inliers = np.ones(instance.problem.m, dtype=bool) if instance.outliers is None else ~instance.outliers
    return efficient_median_deg(instance.problem, inliers, *noise_of(parameters))
