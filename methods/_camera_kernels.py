"""Loops over the cameras of a graph and their neighbours, compiled by numba.

The rules of `_edge_kernels` hold here too.
"""

import math

from bench.problem import Floats, Ints

from ._edge_kernels import _compiled


@_compiled
def median_sweep(
    order: Ints, first: Ints, neighbours: Ints, measured: Floats, met_angle: float, cameras: Floats, turns: Floats
) -> None:
    """Move each camera one Weiszfeld step towards the median of what its neighbours predict, one after the other.

    Where camera i coincides with k of the predictions R_ij R_j the step is that of Vardi and Zhang: the pull
    of the others, a sum of unit vectors, is shortened by k, and the camera stays where nothing is left of it.

    Parameters
    ----------
    order
        (n,) cameras, in the order in which they move.
    first, neighbours
        (n + 1,) and (2m,): the neighbours j of camera i stand from first[i] to first[i + 1].
    measured
        (2m, 4) quaternions of R_ij, in step with `neighbours`.
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
                met += 1
                continue
            unit = 1 / sine if cosine > 0 else -1 / sine
            x, y, z = x + unit * u, y + unit * v, z + unit * t
            stiffness += 1 / angle
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
