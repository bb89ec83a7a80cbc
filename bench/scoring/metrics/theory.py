"""How accurate synchronization can be: the Cramér-Rao bound of Boumal, Singer, Absil and Blondel.

"Cramér-Rao bounds for synchronization of rotations", Information and Inference 3 (2014), for SO(3) and without
anchors. It bounds an average over the noise, not the error of one draw, and speaks of unbiased estimators and
small errors; a method with a prior or a bias can be below it. Its edges are those of the inliers alone: an
estimator that must find out which these are knows less, so that the bound holds for it too.
"""

import numpy as np
from numpy.typing import NDArray

from bench.core.errors import InputError, suggestion
from bench.core.problem import Floats, Problem

NOISES = ("tangent", "langevin")
MOST_TANGENT_DEG = 30.0
STEPS = 20_001
MAXWELL_MEDIAN = 1.5381722544550522  # of the length of a Gaussian vector with covariance I
TAIL = 12  # standard deviations, beyond which there is nothing to integrate


def cramer_rao_rms_deg(problem: Problem, inliers: NDArray[np.bool_], noise: str, noise_deg: float) -> float:
    """Lower bound on the root mean squared error over cameras and draws of the noise, in degrees.

    The square root of the mean of `cramer_rao_variances`, with the same parameters. Errors are angles after any
    alignment: the bound is that of chordal or Karcher's, which leave the least squares. To compare, average the
    *squares* of ``rms_deg`` over seeds, then take the root.
    """
    return float(np.degrees(np.sqrt(cramer_rao_variances(problem, inliers, noise, noise_deg).mean())))


def cramer_rao_variances(problem: Problem, inliers: NDArray[np.bool_], noise: str, noise_deg: float) -> Floats:
    """Lower bounds (n,) on the expected squared angle of each camera's error, rad^2.

    With the gauge removed, the covariance of the error's rotation vector is at least c_i I to leading order,
    where c_i = (L^+)_ii / w: L^+ is the pseudo-inverse of the Laplacian of the inlier edges and w what one
    edge tells (`information`). The bound is 3 c_i (1 - c_i / 3); the second factor is SO(3)'s curvature, as in
    the paper and its code. (There the metric is the Frobenius norm, of length sqrt(2) times the angle, and the
    first factor reads d^2 (L^+)_ii with d = 3.)

    Parameters
    ----------
    problem
        Its graph counts, its measurements do not.
    inliers
        (m,) True on edges whose measurement is not an outlier.
    noise, noise_deg
        As in the datasets, see `information`.

    Returns
    -------
    ndarray
        All NaN where the inliers do not connect the cameras: nothing then ties the parts to each other.

    Raises
    ------
    InputError
        On a noise model without a bound.
    """
    variances = _variances(problem, inliers, noise, noise_deg)
    return 3 * variances * np.maximum(1 - variances / 3, 0)


def efficient_median_deg(problem: Problem, inliers: NDArray[np.bool_], noise: str, noise_deg: float) -> float:
    """Median error over the cameras, in degrees, of an estimator that attains the bound, with the same parameters.

    Not a bound of Cramér and Rao's, which knows squares only: the median over the cameras of the median length of a
    Gaussian vector with covariance c_i I. Least squares attains it in the limit of small noise, and by the local
    asymptotic minimax theorem (Hájek 1972; Le Cam) no method is better there throughout a neighbourhood of the truth.
    It holds after chordal or Karcher's alignment. NaN without connection.
    """
    variances = _variances(problem, inliers, noise, noise_deg)
    return float(np.degrees(MAXWELL_MEDIAN * np.sqrt(np.median(variances))))


def information(noise: str, noise_deg: float) -> float:
    """Fisher information of one measurement on each component of its rotation vector, rad^-2.

    E[(d log f / d angle)^2] / 3 for the density f of the noise on SO(3), by a sum over a fine grid of
    angles; 1 / sigma^2 to leading order, where sigma is `noise_deg` in radians.

    Parameters
    ----------
    noise
        ``tangent``: rotation vectors from N(0, sigma^2 I). ``langevin``: f proportional to
        exp(kappa trace(N)), kappa = 1 / (2 sigma^2).
    noise_deg
        From 0 (infinite information) to 180, for ``tangent`` to 30: further out rotation vectors longer than
        pi, which this leaves out of account, are no longer rare.

    Raises
    ------
    InputError
        On any other noise. The founding paper's ``paper`` noise (a Gaussian angle about a uniform axis) has a
        density that is singular at the identity, like angle^-2: its information is infinite and its bound zero.
    """
    _check(noise, noise_deg)
    sigma = np.radians(noise_deg)
    if sigma == 0:
        return float("inf")
    angle = np.linspace(0, min(np.pi, TAIL * sigma), STEPS)[1:]  # nothing is at 0
    half_sine = np.sin(angle / 2)
    if noise == "tangent":
        density = (angle / sigma) ** 2 * np.exp(-0.5 * (angle / sigma) ** 2)
        score = 2 / angle - 1 / np.tan(angle / 2) - angle / sigma**2
    else:
        density = (half_sine / sigma) ** 2 * np.exp(-2 * (half_sine / sigma) ** 2)
        score = -np.sin(angle) / sigma**2
    return float(np.average(score**2, weights=density)) / 3


def _check(noise: str, noise_deg: float) -> None:
    if noise == "paper":
        raise InputError(
            "there is no Cramér-Rao bound for noise 'paper': its density is singular at the identity, which makes "
            f"the bound zero; choose one of {', '.join(NOISES)}"
        )
    if noise not in NOISES:
        raise InputError(f"there is no Cramér-Rao bound for noise '{noise}'{suggestion(noise, NOISES)}")
    most = MOST_TANGENT_DEG if noise == "tangent" else 180.0
    if not 0 <= noise_deg <= most:
        raise InputError(f"noise_deg must be from 0 to {most:g} for noise '{noise}', not {noise_deg}")


def _variances(problem: Problem, inliers: NDArray[np.bool_], noise: str, noise_deg: float) -> Floats:
    """(n,) variance c_i of each component of a camera's rotation vector, rad^2; NaN without connection."""
    told = information(noise, noise_deg)
    clairvoyant = Problem(problem.n, problem.edges[inliers], problem.rotations[inliers])
    if clairvoyant.components.any():
        return np.full(problem.n, np.nan)
    gauge = 1 / problem.n
    inverse = np.linalg.inv(clairvoyant.laplacian().toarray() + gauge)  # the added matrix maps the kernel to itself
    return (np.diagonal(inverse) - gauge) / told
