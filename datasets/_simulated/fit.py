"""The law of correlated errors of a graph that was measured, without its truth."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Problem, closures, sample_triangles, so3

from .correlated import Law
from .sizes import Sizes
from .upright import Upright, smooth_function

_TRIANGLES = 20_000
_FEWEST = 200
_LEVELS = np.array([0.05, 0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9, 0.95])
_LEAST_DEG = 1e-3  # below which closures count as this
_PRECISE_DEG = 3.0  # median closure below which noise and warp shrink in proportion
# Of ln median, outliers, spread and tail.
_START = np.array([np.log(4.0), 0.15, 1.6, 1.7])
_LOW = np.array([np.log(1e-3), 0.001, 0.5, 0.5])
_HIGH = np.array([np.log(19.0), 0.49, 3.0, 4.0])
_STEPS = np.array([0.02, 0.005, 0.05, 0.05])
_PULL = 0.02  # towards the start, for what triangles do not tell


def fitted(problem: Problem, rng: np.random.Generator, correlated: bool = True) -> tuple[Law, str]:
    """The law whose triangles close as badly as those of a graph, and a sentence that says how well it was found.

    The four parameters of the sizes of errors are found by indirect inference: quantiles of how far triangles are from
    closing, in the graph and as simulated on it from the same random numbers, agree in the sense of least squares of
    their logarithms. The pan of the cameras is scaled to the median angle between cameras as measured. What triangles
    do not tell (coherence, warp, shares) keeps its default; but where half of the triangles close within 3 degrees,
    warp and noise shrink in proportion, so that a graph without errors has a twin without. No truth is used.

    Parameters
    ----------
    problem
        The measured graph. Of a pair that is measured several times, the first measurement closes triangles.
    correlated
        Whether errors are correlated at cameras; else they are independent, and fitted in the same way.
    """
    from scipy.optimize import least_squares

    cameras = _cameras(problem, rng)
    law = Law(cameras=cameras) if correlated else Law.independent(Sizes(), cameras)
    triangles = sample_triangles(problem, _TRIANGLES, rng)
    if len(triangles) < _FEWEST:
        return law, f"the graph has too few triangles to fit the size of errors to: {law.sizes}"
    observed = _quantiles(problem.rotations, triangles)
    precise = min(1.0, float(np.exp(observed[_LEVELS == 0.5][0])) / _PRECISE_DEG)
    law = replace(law, warp_deg=precise * law.warp_deg, noise_deg=precise * law.noise_deg)
    draw = law.draw(problem.n, problem.edges, rng)
    edges, inverse = np.unique(triangles, return_inverse=True)
    within = inverse.reshape(triangles.shape)

    def misfit(values: Floats) -> Floats:
        simulated = _quantiles(draw.measured(_sizes(values).of(draw.quality), edges), within)
        return np.concatenate([simulated - observed, _PULL * (values - _START)])

    found = least_squares(
        misfit, _START, bounds=(_LOW, _HIGH), diff_step=_STEPS / np.abs(_START), x_scale=_STEPS, max_nfev=30
    )
    worst = float(np.exp(np.abs(found.fun[: len(_LEVELS)]).max()))
    return replace(law, sizes=_sizes(found.x)), f"quantiles of triangle closures fitted within a factor {worst:.2f}"


def _sizes(values: Floats) -> Sizes:
    logarithm, *others = values.tolist()
    return Sizes(float(np.exp(logarithm)), *others)


def _quantiles(rotations: Floats, triangles: NDArray[np.intp]) -> Floats:
    """Logarithms of quantiles of how far triangles are from closing, degrees."""
    degrees = np.degrees(closures(rotations, triangles))
    return np.log(np.maximum(np.quantile(degrees, _LEVELS), _LEAST_DEG))


def _cameras(problem: Problem, rng: np.random.Generator) -> Upright:
    """How cameras are turned, the pan in proportion to the median angle measured."""
    cameras = Upright()
    smooth = smooth_function(problem.n, problem.edges, rng)
    measured = np.median(so3.angle(problem.rotations))
    i, j = problem.edges.T
    for _ in range(2):
        simulated = cameras.rotations(smooth, rng)
        scale = measured / np.median(so3.angle_between(simulated[i], simulated[j]))
        cameras = replace(cameras, pan_deg=cameras.pan_deg * scale, jitter_deg=cameras.jitter_deg * scale)
    return cameras
