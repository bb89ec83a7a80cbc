"""Robust losses of an angle, each with the weight that iteratively reweighted least squares gives it.

With x = angle / (tuning * sigma) every loss is scaled so that it is x^2 / 2 for small x, except the l1 and
l1/2 losses, which have no scale. The weight is the derivative of the loss divided by the angle, times
(tuning * sigma)^2.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bench.problem import Floats

SMALLEST_ANGLE = 5e-6  # radians; keeps the weights of l1 and l1/2 finite, at most about 1e8 as published


@dataclass(frozen=True)
class Loss:
    """A loss and its weight, as functions of x >= 0 (m,).

    Parameters
    ----------
    value, weight
        rho(x), and rho'(x) / x up to a constant factor.
    tuning
        Multiplies sigma. The constants are those of 95 % efficiency under Gaussian noise (Holland and
        Welsch 1977), as in Chatterjee and Govindu; pseudo-Huber takes Huber's, Geman-McClure 1; None for
        losses without a scale.
    """

    value: Callable[[Floats], Floats]
    weight: Callable[[Floats], Floats]
    tuning: float | None = None

    def scale(self, sigma: float) -> float:
        """What an angle is divided by: tuning times `sigma`, or 1 radian for losses without a scale."""
        return 1.0 if self.tuning is None else self.tuning * sigma


LOSSES: dict[str, Loss] = {
    "l2": Loss(lambda x: x**2 / 2, np.ones_like),
    "l1": Loss(lambda x: x, lambda x: 1 / np.maximum(x, SMALLEST_ANGLE)),
    "l-half": Loss(lambda x: 2 * np.sqrt(x), lambda x: np.maximum(x, SMALLEST_ANGLE) ** -1.5),
    "geman-mcclure": Loss(lambda x: x**2 / (2 * (1 + x**2)), lambda x: 1 / (1 + x**2) ** 2, 1.0),
    "huber": Loss(lambda x: np.where(x < 1, x**2 / 2, x - 0.5), lambda x: 1 / np.maximum(x, 1), 1.345),
    "pseudo-huber": Loss(lambda x: np.sqrt(1 + x**2) - 1, lambda x: 1 / np.sqrt(1 + x**2), 1.345),
    "cauchy": Loss(lambda x: np.log1p(x**2) / 2, lambda x: 1 / (1 + x**2), 2.385),
    "welsch": Loss(lambda x: -np.expm1(-(x**2)) / 2, lambda x: np.exp(-(x**2)), 2.985),
    "andrews": Loss(lambda x: 1 - np.cos(np.minimum(x, np.pi)), lambda x: np.sinc(np.minimum(x / np.pi, 1)), 1.339),
    "bisquare": Loss(lambda x: (1 - np.maximum(1 - x**2, 0) ** 3) / 6, lambda x: np.maximum(1 - x**2, 0) ** 2, 4.685),
    "fair": Loss(lambda x: x - np.log1p(x), lambda x: 1 / (1 + x), 1.4),
    "talwar": Loss(lambda x: np.minimum(x, 1) ** 2 / 2, lambda x: (x < 1).astype(float), 2.795),
}
