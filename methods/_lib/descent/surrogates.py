"""The families of costs that graduated non-convexity goes through."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench import Floats

FACTOR = 1.4  # by which the surrogate approaches the cost, as published
BINARY = 1e-4  # weights this close to 0 or 1 are 0 or 1, as in GTSAM
LARGEST_FIRST = 1e6  # mu, where no residual is large enough to be doubted

GncLoss = Literal["tls", "geman-mcclure"]


@dataclass(frozen=True)
class Surrogate:
    """A family of costs that leads from a nearly convex one to a robust one.

    Its functions take x = (residual / threshold)^2 (m,) and the control parameter mu.

    Parameters
    ----------
    cost
        The robust cost of each edge.
    weight
        Weights (m,) of the squared residuals, in [0, 1].
    first, following
        mu for the largest x; the mu after a mu.
    arrived
        Whether the surrogate with this mu, and with the weights that it gave, is the robust cost.
    """

    cost: Callable[[Floats], Floats]
    weight: Callable[[Floats, float], Floats]
    first: Callable[[float], float]
    following: Callable[[float], float]
    arrived: Callable[[float, Floats], bool]


def tls_weight(x: Floats, mu: float) -> Floats:
    """Weights (m,): 1 up to x = mu / (mu + 1), 0 from (mu + 1) / mu, between them sqrt(mu (mu + 1) / x) - mu."""
    x = np.maximum(x, mu / (mu + 1))
    # The difference of two numbers that grow with mu, written as one fraction.
    return np.maximum((mu + mu**2 * (1 - x)) / (x * (np.sqrt(mu * (mu + 1) / x) + mu)), 0.0)


SURROGATES: dict[GncLoss, Surrogate] = {
    "tls": Surrogate(
        cost=lambda x: np.minimum(x, 1.0),
        weight=tls_weight,
        first=lambda largest: 1 / max(2 * largest - 1, 1 / LARGEST_FIRST),
        following=lambda mu: mu * FACTOR,
        arrived=lambda mu, weights: bool((np.minimum(weights, 1 - weights) < BINARY).all()),
    ),
    "geman-mcclure": Surrogate(
        cost=lambda x: x / (1 + x),
        weight=lambda x, mu: (mu / (mu + x)) ** 2,
        first=lambda largest: max(2 * largest, 1.0),
        following=lambda mu: max(mu / FACTOR, 1.0),
        arrived=lambda mu, weights: mu == 1,
    ),
}
