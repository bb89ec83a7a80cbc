"""Loops over the cameras of a graph that move one camera at a time, compiled by numba.

As in the loops over edges, a kernel is compiled at its first call and cached on disk.
"""

import math

import numpy as np

from bench.problem import Floats, Ints

from ._edge_kernels import compiled

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
