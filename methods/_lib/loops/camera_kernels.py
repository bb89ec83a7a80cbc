"""Loops over the cameras of a graph that move one camera at a time, compiled by numba.

As in the loops over edges, a kernel is compiled at its first call and cached on disk.
"""

import math

import numpy as np

from bench import Floats, Ints

from .edge_kernels import compiled

SINGULAR = 1e-6  # of the determinant, relative to the cube of the norm; below it the SVD decides
MOST_NEWTON_STEPS = 20  # five to seven are usual
SMALL_STEP = 1e-18  # squared; convergence is quadratic, so that the next step would be rounding


@compiled
def rotation_sweep(first: Ints, neighbours: Ints, measured: Floats, rotations: Floats, gain: Floats) -> None:
    """Replace one camera after another by the rotation nearest to M_k = sum_j R_kj R_j.

    The orthogonal factor of M_k comes from Newton's iteration X <- (X + X^-T) / 2, scaled (Higham 1986),
    where the determinant is clearly positive; otherwise from the singular value decomposition, which knows
    what to do with reflections.

    Parameters
    ----------
    first, neighbours, measured
        (n + 1,), (2m,) and (2m, 3, 3), see `Neighbours`.
    rotations
        (n, 3, 3) R_k, changed in place.
    gain
        (1,) filled with the sum over the cameras of the growth of tr(M_k^T R_k), which is half of what the
        sum of squared chordal residuals falls by.
    """
    total = np.empty((3, 3))
    x = np.empty((3, 3))
    cofactors = np.empty((3, 3))
    gain[0] = 0.0
    for k in range(rotations.shape[0]):
        total[:] = 0.0
        for e in range(first[k], first[k + 1]):
            j = neighbours[e]
            for a in range(3):
                for b in range(3):
                    total[a, b] += (
                        measured[e, a, 0] * rotations[j, 0, b]
                        + measured[e, a, 1] * rotations[j, 1, b]
                        + measured[e, a, 2] * rotations[j, 2, b]
                    )
        x[:] = total
        regular = False
        for _ in range(MOST_NEWTON_STEPS):
            for a in range(3):
                for b in range(3):
                    c, d, e, f = (a + 1) % 3, (a + 2) % 3, (b + 1) % 3, (b + 2) % 3
                    cofactors[a, b] = x[c, e] * x[d, f] - x[c, f] * x[d, e]
            determinant = (x[0] * cofactors[0]).sum()
            size = math.sqrt((x * x).sum())
            if determinant <= SINGULAR * size**3:
                break
            scale = math.sqrt(math.sqrt((cofactors * cofactors).sum()) / (determinant * size))
            step = 0.0
            for a in range(3):
                for b in range(3):
                    following = 0.5 * (scale * x[a, b] + cofactors[a, b] / (scale * determinant))
                    step += (following - x[a, b]) ** 2
                    x[a, b] = following
            if step < SMALL_STEP:
                regular = True
                break
        if not regular:
            u, _, vt = np.linalg.svd(total)
            if np.linalg.det(u) * np.linalg.det(vt) < 0:
                u[:, 2] = -u[:, 2]
            x[:] = u @ vt
        for a in range(3):
            for b in range(3):
                gain[0] += total[a, b] * (x[a, b] - rotations[k, a, b])
                rotations[k, a, b] = x[a, b]


@compiled
def median_sweep(
    order: Ints,
    first: Ints,
    neighbours: Ints,
    measured: Floats,
    weights: Floats,
    met_angle: float,
    cameras: Floats,
    turns: Floats,
) -> None:
    """Move each camera one Weiszfeld step towards the median of what its neighbours predict, one after the other.

    Where camera i coincides with predictions R_ij R_j whose weights add up to k, the step is that of Vardi and Zhang:
    the pull of the others, a weighted sum of unit vectors, is shortened by k, and the camera stays where nothing is
    left of it.

    Parameters
    ----------
    order
        (n,) cameras, in the order in which they move.
    first, neighbours
        (n + 1,) and (2m,): the neighbours j of camera i stand from first[i] to first[i + 1].
    measured
        (2m, 4) quaternions of R_ij, in step with `neighbours`.
    weights
        (2m,) of these predictions.
    met_angle
        Radians below which a prediction and the camera are the same.
    cameras
        (n, 4) quaternions of R_i, changed in place.
    turns
        (n,) filled with the angles of the moves.
    """
    for i in order:
        p, q, r, s = cameras[i, 0], -cameras[i, 1], -cameras[i, 2], -cameras[i, 3]
        x, y, z, stiffness, met = 0.0, 0.0, 0.0, 0.0, 0.0
        for h in range(first[i], first[i + 1]):
            j = neighbours[h]
            w, a, b, c = cameras[j, 0], cameras[j, 1], cameras[j, 2], cameras[j, 3]
            w, a, b, c = (
                w * p - a * q - b * r - c * s,
                w * q + a * p + b * s - c * r,
                w * r - a * s + b * p + c * q,
                w * s + a * r - b * q + c * p,
            )
            d, e, f, g = measured[h, 0], measured[h, 1], measured[h, 2], measured[h, 3]
            cosine = d * w - e * a - f * b - g * c
            u = d * a + e * w + f * c - g * b
            v = d * b - e * c + f * w + g * a
            t = d * c + e * b - f * a + g * w
            sine = math.sqrt(u * u + v * v + t * t)
            angle = 2 * math.atan2(sine, abs(cosine))
            if angle < met_angle:
                met += weights[h]
                continue
            unit = weights[h] / sine if cosine > 0 else -weights[h] / sine
            x, y, z = x + unit * u, y + unit * v, z + unit * t
            stiffness += weights[h] / angle
        pull = math.sqrt(x * x + y * y + z * z)
        turns[i] = 0.0
        if pull <= met or stiffness == 0:
            continue
        turns[i] = (pull - met) / stiffness
        scale = math.sin(turns[i] / 2) / pull
        w, a, b, c = math.cos(turns[i] / 2), scale * x, scale * y, scale * z
        q, r, s = -q, -r, -s
        w, a, b, c = (
            w * p - a * q - b * r - c * s,
            w * q + a * p + b * s - c * r,
            w * r - a * s + b * p + c * q,
            w * s + a * r - b * q + c * p,
        )
        norm = math.sqrt(w * w + a * a + b * b + c * c)
        cameras[i, 0], cameras[i, 1], cameras[i, 2], cameras[i, 3] = w / norm, a / norm, b / norm, c / norm
