"""How far an estimate is from the truth, camera by camera, and from the measurements, edge by edge."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.problem import Floats, Problem
from bench.scoring.metrics.alignment import align

TOGETHER = 10_000  # cameras aligned at once
WITHIN_DEG = (1, 3, 5, 10, 30)
AUC_DEG = (1, 5, 10)


def camera_errors(rotations: Floats, truth: Floats, rule: str = "l1") -> Floats:
    """Angles (n,) in degrees between the aligned estimate and the truth; NaN where either is missing.

    The gauge is taken from the cameras that are both solved and known, and from no others. Angles come from
    atan2, and are exact down to the rounding of the entries (about 1e-14 degrees).

    Parameters
    ----------
    rotations
        (n, 3, 3), NaN where a camera was not solved.
    truth
        (n, 3, 3), NaN where unknown.
    rule
        One of `bench.scoring.metrics.alignment.RULES`.
    """
    return all_camera_errors([(rotations, truth)], rule)[0]


def all_camera_errors(pairs: Sequence[tuple[Floats, Floats]], rule: str = "l1") -> list[Floats]:
    """`camera_errors` of many estimates, each with its truth; small ones of one size are aligned together."""
    common = [np.flatnonzero(_known(rotations) & _known(truth)) for rotations, truth in pairs]
    errors = [np.full(len(truth), np.nan) for _, truth in pairs]
    for size in {len(cameras) for cameras in common} - {0}:
        alike = [k for k, cameras in enumerate(common) if len(cameras) == size]
        together = max(1, TOGETHER // size)
        for start in range(0, len(alike), together):
            chosen = alike[start : start + together]
            estimates = np.stack([pairs[k][0][common[k]] for k in chosen])
            truths = np.stack([pairs[k][1][common[k]] for k in chosen])
            gauges = align(estimates, truths, rule)
            angles = np.degrees(so3.angle_between(estimates @ gauges[:, None], truths))
            for k, of_estimate in zip(chosen, angles, strict=True):
                errors[k][common[k]] = of_estimate
    return errors


def summary(errors: Floats) -> dict[str, float]:
    """Scalars of the errors (n,) of one estimate, in degrees.

    NaN entries take no part in anything: the shares ``within_5_deg`` and so on are shares of the *scored*
    cameras, and a camera that was not solved counts neither as a hit nor as a miss. A method that leaves out
    the hard cameras thus looks better than it is, which is why ``n_scored`` belongs beside every number here.

    Returns
    -------
    dict
        ``mean_deg, median_deg, rms_deg, p90_deg, max_deg`` (the worst camera), ``within_{1,3,5,10,30}_deg``
        in [0, 1], ``auc_{1,5,10}_deg`` (see `recall_auc`), and the integer ``n_scored``. All but the last are NaN where
        nothing was scored.
    """
    scored = errors[np.isfinite(errors)]
    n_scored = len(scored)
    if n_scored == 0:
        shares = (*(f"within_{limit}" for limit in WITHIN_DEG), *(f"auc_{limit}" for limit in AUC_DEG))
        return {f"{name}_deg": np.nan for name in ("mean", "median", "rms", "p90", "max", *shares)} | {"n_scored": 0}
    return {
        "mean_deg": float(scored.mean()),
        "median_deg": float(np.median(scored)),
        "rms_deg": float(np.sqrt(np.mean(scored**2))),
        "p90_deg": float(np.percentile(scored, 90)),
        "max_deg": float(scored.max()),
        **{f"within_{limit}_deg": float((scored < limit).mean()) for limit in WITHIN_DEG},
        **{f"auc_{limit}_deg": recall_auc(scored, limit) for limit in AUC_DEG},
        "n_scored": n_scored,
    }


def recall_auc(errors: Floats, limit_deg: float) -> float:
    """Area under the recall curve of errors (n,) in degrees up to a limit, divided by it: in [0, 1], 1 being exact.

    Recall at an angle is the share of the errors below it. The area is that of the step function itself, the mean of
    max(0, 1 - error / limit), and not that of a polygon or histogram, which depend on where they are sampled.
    """
    return float(np.maximum(1 - errors / limit_deg, 0).mean())


def edge_metrics(problem: Problem, rotations: Floats, truth: Floats | None = None) -> dict[str, float]:
    """How well an estimate explains the measurements, and whether the truth explains them better.

    Where the estimate's cost is at or below the truth's, the method found the optimum of the wrong cost;
    where it is above, the method is stuck (or minimises something else).

    Parameters
    ----------
    problem
        The measurements.
    rotations
        (n, 3, 3), NaN where a camera was not solved.
    truth
        (n, 3, 3), NaN where unknown, or None.

    Returns
    -------
    dict
        ``residual_mean_deg, residual_median_deg``: angles between R_ij and R_i R_j^T over the edges whose
        cameras are solved. ``cost_l1, cost_l1_truth``: geodesic cost, mean angle in radians; ``cost_l2,
        cost_l2_truth``: chordal cost, mean of ||R_ij - R_i R_j^T||_F^2. Costs are means, so that scenes
        compare, over the edges whose cameras are solved and (where a truth is given) known. NaN where there
        is no such edge or no truth.
    """
    residuals = problem.residuals(rotations)
    at_truth = np.full(problem.m, np.nan) if truth is None else problem.residuals(truth)
    compared = np.isfinite(residuals) & (np.isfinite(at_truth) | (truth is None))
    solved = residuals[np.isfinite(residuals)]
    return {
        "residual_mean_deg": float(np.degrees(_mean(solved))),
        "residual_median_deg": float(np.degrees(np.median(solved))) if len(solved) else float("nan"),
        "cost_l1": _mean(residuals[compared]),
        "cost_l1_truth": _mean(at_truth[compared]),
        "cost_l2": _mean(_squared_chord(residuals[compared])),
        "cost_l2_truth": _mean(_squared_chord(at_truth[compared])),
    }


def _known(rotations: Floats) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(rotations).all(axis=(1, 2)))


def _squared_chord(angles: Floats) -> Floats:
    """||A - B||_F^2 of rotations that are `angles` apart."""
    return 8 * np.sin(angles / 2) ** 2


def _mean(values: Floats) -> float:
    return float(values.mean()) if len(values) else float("nan")
