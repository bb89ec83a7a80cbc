"""Compiled loops of geodesic Langevin dynamics on unit quaternions (w, x, y, z)."""

import math

from bench import Floats, Ints

from .edge_kernels import compiled


@compiled
def bingham_forces(
    edges: Ints, measured: Floats, weights: Floats, cameras: Floats, forces: Floats, energy: Floats
) -> None:
    """Energy sum_ij w_ij (1 - <q_ij, q_i conj(q_j)>^2) and minus its gradient.

    Parameters
    ----------
    edges, measured, weights, cameras
        (m, 2), (m, 4), (m,) and (n, 4); the signs of the quaternions do not matter.
    forces, energy
        (n, 4) and (1,), filled.
    """
    forces[:] = 0
    energy[0] = 0
    for k in range(edges.shape[0]):
        i, j = edges[k, 0], edges[k, 1]
        w, x, y, z = measured[k]
        a, b, c, d = cameras[j]
        i0 = w * a - x * b - y * c - z * d
        i1 = w * b + x * a + y * d - z * c
        i2 = w * c - x * d + y * a + z * b
        i3 = w * d + x * c - y * b + z * a
        a, b, c, d = cameras[i]
        cosine = a * i0 + b * i1 + c * i2 + d * i3
        energy[0] += weights[k] * (1 - cosine * cosine)
        pull = 2 * weights[k] * cosine
        forces[i, 0] += pull * i0
        forces[i, 1] += pull * i1
        forces[i, 2] += pull * i2
        forces[i, 3] += pull * i3
        forces[j, 0] += pull * (w * a + x * b + y * c + z * d)
        forces[j, 1] += pull * (w * b - x * a - y * d + z * c)
        forces[j, 2] += pull * (w * c + x * d - y * a - z * b)
        forces[j, 3] += pull * (w * d - x * c + y * b - z * a)


@compiled
def geodesic_step(
    cameras: Floats, velocities: Floats, forces: Floats, masses: Floats, kicks: Floats, keep: float, h: float
) -> None:
    """Damp the velocities, add forces and kicks, and move every camera along its great circle.

    Parameters
    ----------
    cameras, velocities
        (n, 4), updated; velocities are tangent.
    forces, kicks
        (n, 4) of which the tangent parts count. Kicks are velocities.
    masses
        (n,).
    keep
        Share of the velocity that friction leaves in one step.
    h
        Length of the step in time.
    """
    for i in range(cameras.shape[0]):
        along = 0.0
        for k in range(4):
            velocities[i, k] = keep * velocities[i, k] + h * forces[i, k] / masses[i] + kicks[i, k]
            along += velocities[i, k] * cameras[i, k]
        speed = 0.0
        for k in range(4):
            velocities[i, k] -= along * cameras[i, k]
            speed += velocities[i, k] * velocities[i, k]
        speed = math.sqrt(speed)
        if speed == 0:
            continue
        sine, cosine = math.sin(speed * h), math.cos(speed * h)
        norm = 0.0
        for k in range(4):
            q, v = cameras[i, k], velocities[i, k]
            cameras[i, k] = cosine * q + sine / speed * v
            velocities[i, k] = cosine * v - sine * speed * q
            norm += cameras[i, k] * cameras[i, k]
        for k in range(4):
            cameras[i, k] /= math.sqrt(norm)
