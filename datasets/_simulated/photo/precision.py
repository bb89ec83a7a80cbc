"""How well two pictures tell their relative rotation."""

import numpy as np

from bench import Floats, so3

_FLOOR = 1e-4  # of the root mean square residual, over the focal length: a tenth of a pixel
_PRIOR = 1.0  # rad^-2 on rotation and direction, so that what pictures leave open stays finite


def precision(first: Floats, second: Floats, rotation: Floats, direction: Floats) -> Floats:
    """Precision (3, 3), rad^-2, of d in R_ij = exp(d) R_i R_j^T, the direction of the baseline eliminated.

    Gauss-Newton's matrix of the Sampson errors at the estimate, over their mean square: what an estimator can know,
    which takes no account of wrong focal lengths and of distortion, so that sigmas are too small.

    Parameters
    ----------
    first, second
        (k, 2) of the inliers, relative to the centre of the picture and over the focal length.
    rotation, direction
        As in `two_view.TwoViews`.
    """
    x, y = (np.column_stack([pixels, np.ones(len(pixels))]) for pixels in (first, second))
    t = direction / np.linalg.norm(direction)
    essential = so3.hat(t) @ rotation.T
    lines, back = x @ essential.T, y @ essential
    slope = np.sqrt(np.sum(lines[:, :2] ** 2, axis=1) + np.sum(back[:, :2] ** 2, axis=1))
    residuals = np.sum(y * lines, axis=1) / slope
    _, _, axes = np.linalg.svd(t[None])
    changes = [-essential @ so3.hat(e) for e in np.eye(3)]
    changes += [so3.hat(axis) @ rotation.T for axis in axes[1:]]
    jacobian = np.stack([np.einsum("ka,ab,kb->k", y, change, x) for change in changes], axis=1) / slope[:, None]
    normal = jacobian.T @ jacobian / max(np.mean(residuals**2), _FLOOR**2) + _PRIOR * np.eye(5)
    reduced = normal[:3, :3] - normal[:3, 3:] @ np.linalg.solve(normal[3:, 3:], normal[3:, :3])
    return (reduced + reduced.T) / 2
