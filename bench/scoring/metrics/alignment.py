"""Removing the gauge: the rotation of the world that best brings an estimate onto the truth.

R_i R_j^T does not change under R_i -> R_i Q, so an estimate is compared with the truth after a choice of Q.
Publications choose in at least five ways, and on hard scenes the choice moves a median by degrees; the rule
is therefore a named variable. Every rule here is deterministic and follows the world: rotating the world of
the estimate or of the truth leaves the errors as they are.
"""

import numpy as np

from bench.core import so3
from bench.core.errors import InputError, suggestion
from bench.core.problem import Floats

ANCHORS = 32
ANCHOR_ITERATIONS = 20
ANCHOR_TOLERANCE = 1e-5  # radians

_MEANS = {"chordal": so3.chordal_mean, "karcher": so3.karcher_mean}
RULES = ("l1", *_MEANS, "anchors")


def align(estimate: Floats, truth: Floats, rule: str = "l1") -> Floats:
    """Gauge (..., 3, 3) Q with estimate_i @ Q ~ truth_i.

    Parameters
    ----------
    estimate, truth
        (..., k, 3, 3), k >= 1, all finite: the cameras that are both solved and known.
    rule
        The centre that is taken of the rotations Q_i = estimate_i^T truth_i:

        - ``l1``: sum of angles least, by Weiszfeld's iteration (HARA, Arrigoni's and DMF-Synch's MATLAB
          code);
        - ``chordal``: sum of squared chordal distances least, by SVD (MPLS);
        - ``karcher``: sum of squared angles least (GTSfM);
        - ``anchors``: Chatterjee and Govindu's, see `_anchored`.

    Raises
    ------
    InputError
        On an unknown rule.
    """
    if rule not in RULES:
        raise InputError(f"there is no alignment rule '{rule}'{suggestion(rule, RULES)}")
    if rule == "l1":
        return so3.geodesic_median(np.swapaxes(estimate, -1, -2) @ truth)
    if estimate.ndim > 3:
        return np.array([align(e, t, rule) for e, t in zip(estimate, truth, strict=True)])
    return _anchored(estimate, truth) if rule == "anchors" else _MEANS[rule](np.swapaxes(estimate, -1, -2) @ truth)


def _anchored(estimate: Floats, truth: Floats) -> Floats:
    """Component-wise median of residual rotation vectors in the frame of an anchor camera, best anchor kept.

    As in CompareRotationGraph.m (Chatterjee and Govindu) and DMF-Synch's rotmap.py: both sets are moved into
    the frame of one camera; the component-wise median of the rotation vectors left between them is applied
    until it is below 1e-5 rad, at most 20 times; of several anchors the one with the smallest mean error is
    kept. Deviation: up to `ANCHORS` evenly spaced cameras (all, where there are no more) instead of four
    random ones, so that a score is a function of the estimate.
    """
    anchors = np.unique(np.linspace(0, len(estimate) - 1, ANCHORS).astype(int))
    gauges = [_anchored_at(estimate, truth, anchor) for anchor in anchors]
    means = [so3.angle_between(estimate @ gauge, truth).mean() for gauge in gauges]
    return gauges[int(np.argmin(means))]


def _anchored_at(estimate: Floats, truth: Floats, anchor: np.intp) -> Floats:
    local = estimate[anchor] @ np.swapaxes(estimate, -1, -2) @ truth @ truth[anchor].T
    gauge = np.eye(3)
    for _ in range(ANCHOR_ITERATIONS):
        step = np.median(so3.log(local @ gauge.T), axis=0)
        gauge = so3.exp(step) @ gauge
        if np.linalg.norm(step) < ANCHOR_TOLERANCE:
            break
    return np.asarray(estimate[anchor].T @ gauge @ truth[anchor])
