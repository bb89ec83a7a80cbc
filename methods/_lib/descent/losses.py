"""Robust losses of an angle, each with the weight that iteratively reweighted least squares gives it.

With x = angle / (tuning * sigma) every loss is scaled so that it is x^2 / 2 for small x, except the l1, l1.5
and l1/2 losses, which have no scale. The weight is the derivative of the loss divided by the angle, times
(tuning * sigma)^2.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench import Floats

LossName = Literal[
    "geman-mcclure",
    "l-half",
    "l1",
    "l1.5",
    "l2",
    "huber",
    "pseudo-huber",
    "cauchy",
    "welsch",
    "andrews",
    "bisquare",
    "fair",
    "talwar",
    "magsac",
]

SMALLEST_ANGLE = 5e-6  # radians; keeps the weights of l1, l1.5 and l1/2 finite, at most about 1e8 as published


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


MAGSAC_CUT = 3.3682  # of sigma: the 99 % quantile of the length of a standard normal vector in three dimensions
_MAGSAC_TAIL = np.exp(-(MAGSAC_CUT**2) / 2)


def magsac_value(x: Floats) -> Floats:
    """Loss (m,) with the weight `magsac_weight` at x (m,); constant from the cut on."""
    square = np.minimum(x**2, MAGSAC_CUT**2 / 2)
    return (-np.expm1(-square) - _MAGSAC_TAIL * square) / (2 * (1 - _MAGSAC_TAIL))


def magsac_weight(x: Floats) -> Floats:
    """Likelihood (m,) of residuals x (m,), averaged over the noise levels up to sigma; x is residual / (sqrt(2) sigma).

    MAGSAC++ (Barath et al., CVPR 2020) takes the residual for the length of a normal vector, cut at its 99 %
    quantile k, whose standard deviation is uniform on [0, sigma]. With the three degrees of freedom of a
    rotation its incomplete gamma functions are exponentials: the weight is
    exp(-r^2 / (2 sigma^2)) - exp(-k^2 / 2) up to r = k sigma and 0 from there on, scaled here to 1 at r = 0.
    Zhang, Larsson and Barath, CVPR 2023, average rotations with it. There the residuals are divided by the
    covariances of the two-view geometries, which need the point matches; here sigma is the same for all
    edges.
    """
    return np.maximum(np.exp(-(x**2)) - _MAGSAC_TAIL, 0) / (1 - _MAGSAC_TAIL)


LOSSES: dict[str, Loss] = {
    "l2": Loss(lambda x: x**2 / 2, np.ones_like),
    "l1": Loss(lambda x: x, lambda x: 1 / np.maximum(x, SMALLEST_ANGLE)),
    "l1.5": Loss(lambda x: x**1.5 / 1.5, lambda x: np.maximum(x, SMALLEST_ANGLE) ** -0.5),
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
    "magsac": Loss(magsac_value, magsac_weight, float(np.sqrt(2))),
}
