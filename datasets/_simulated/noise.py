"""Random rotations near the identity, by which simulated measurements are wrong.

Every model is isotropic, and its scale is `noise_deg` or sigma, the same in radians.
"""

from collections.abc import Callable
from typing import Literal

import numpy as np

from bench import Floats, so3

Noise = Literal["paper", "tangent", "langevin"]


def sample(noise: Noise, noise_deg: float, rng: np.random.Generator, size: int) -> Floats:
    """Rotations (size, 3, 3) from a noise model.

    Parameters
    ----------
    noise
        ``paper``: an angle from N(0, sigma^2) about a uniform axis (Tejus et al. 2023, section IV-A). Its
        density on SO(3) is singular at the identity, so that it has no Cramér-Rao bound.
        ``tangent``: a rotation vector from N(0, sigma^2 I).
        ``langevin``: a density proportional to exp(kappa trace(N)) with kappa = 1 / (2 sigma^2) (Boumal et al.
        2014). The trace is 3 - angle^2 to leading order, so that this is the tangent model where sigma is
        small; sigma without end gives uniform rotations.
    noise_deg
        Standard deviation of the angle (``paper``) or of each component of the rotation vector (to leading
        order for ``langevin``), degrees; the root mean squared angle of the latter two is sqrt(3) times it.
        At 0 every rotation is the identity.
    """
    return _SAMPLERS[noise](np.radians(noise_deg), rng, size)


def _paper(sigma: float, rng: np.random.Generator, size: int) -> Floats:
    angles = sigma * rng.standard_normal((size, 1))
    return so3.exp(angles * so3.random_axes(rng, size))


def _tangent(sigma: float, rng: np.random.Generator, size: int) -> Floats:
    return so3.exp(sigma * rng.standard_normal((size, 3)))


def _langevin(sigma: float, rng: np.random.Generator, size: int) -> Floats:
    """Exact, by rejection.

    The unit quaternion (w, v) of N has trace(N) = 3 - 4 |v|^2, hence the density exp(-a |v|^2) with
    a = 2 / sigma^2: a Bingham distribution. The envelope of Kent, Ganeiber and Mardia (2013) is the angular
    central Gaussian distribution: normalised vectors from N(0, diag(1, c, c, c)), c = 1 / (1 + 2 a / b), where
    1 / b + 3 / (b + 2 a) = 1. The ratio of the densities is largest where a |v|^2 = (4 - b) / 2. Some 45 % of
    the proposals are accepted for small sigma, and more for larger.
    """
    if sigma == 0:
        return np.tile(np.eye(3), (size, 1, 1))
    a = 2 / sigma**2
    b = 2 * a / (a - 2 + np.sqrt((a - 2) ** 2 + 2 * a))
    deviations = np.array([1.0, *3 * [1 / np.sqrt(1 + 2 * a / b)]])
    accepted = np.empty((0, 4))
    while len(accepted) < size:
        q = deviations * rng.standard_normal((2 * (size - len(accepted)) + 16, 4))
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        x = a * np.sum(q[:, 1:] ** 2, axis=1)
        log_ratio = (4 - b) / 2 - x + 2 * np.log((b + 2 * x) / 4)
        accepted = np.concatenate([accepted, q[np.log1p(-rng.random(len(q))) < log_ratio]])
    return so3.from_quaternion(accepted[:size])


_SAMPLERS: dict[str, Callable[[float, np.random.Generator, int], Floats]] = {
    "paper": _paper,
    "tangent": _tangent,
    "langevin": _langevin,
}
