"""Loops over the edges of a graph, compiled by numba.

A kernel is compiled at its first call and cached on disk, so that importing this module costs nothing.
The kernels write into the arrays given last and allocate nothing. Rotations are unit quaternions (w, x, y,
z), or matrices where named so.
"""

import functools
import math
from collections.abc import Callable
from typing import ParamSpec

from bench.problem import Floats, Ints

P = ParamSpec("P")


def compiled(loop: Callable[P, None]) -> Callable[P, None]:
    @functools.cache
    def machine_code() -> Callable[P, None]:
        import numba

        return numba.njit(cache=True)(loop)

    @functools.wraps(loop)
    def call(*args: P.args, **kwargs: P.kwargs) -> None:
        machine_code()(*args, **kwargs)

    return call


@compiled
def edge_residuals(edges: Ints, measured: Floats, cameras: Floats, vectors: Floats, angles: Floats) -> None:
    """Rotation vectors of R_i^T R_ij R_j, the residual of each edge seen in the world frame.

    Parameters
    ----------
    edges
        (m, 2).
    measured, cameras
        (m, 4) and (n, 4): R_ij and R_i.
    vectors, angles
        Filled with the rotation vectors (m, 3) and their norms (m,) in [0, pi], radians.
    """
    for e in range(edges.shape[0]):
        i, j = edges[e, 0], edges[e, 1]
        w, x, y, z = cameras[i, 0], -cameras[i, 1], -cameras[i, 2], -cameras[i, 3]
        a, b, c, d = measured[e, 0], measured[e, 1], measured[e, 2], measured[e, 3]
        w, x, y, z = (
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        )
        a, b, c, d = cameras[j, 0], cameras[j, 1], cameras[j, 2], cameras[j, 3]
        cosine = w * a - x * b - y * c - z * d
        u = w * b + x * a + y * d - z * c
        v = w * c - x * d + y * a + z * b
        t = w * d + x * c - y * b + z * a
        sine = math.sqrt(u * u + v * v + t * t)
        angle = 2 * math.atan2(sine, abs(cosine))
        scale = angle / sine if sine > 0 else 2.0
        if cosine < 0:
            scale = -scale
        vectors[e, 0], vectors[e, 1], vectors[e, 2] = scale * u, scale * v, scale * t
        angles[e] = angle


@compiled
def divergence(edges: Ints, weights: Floats, vectors: Floats, degrees: Floats, sums: Floats) -> None:
    """Sum what the edges of each camera carry.

    Parameters
    ----------
    edges, weights, vectors
        (m, 2), (m,) and (m, 3).
    degrees
        (n,) filled with the sums of the weights of the edges of each camera.
    sums
        (n, 3) filled with the sums of weight times vector, taken positive at i and negative at j.
    """
    degrees[:] = 0
    sums[:] = 0
    for e in range(edges.shape[0]):
        i, j, w = edges[e, 0], edges[e, 1], weights[e]
        degrees[i] += w
        degrees[j] += w
        for k in range(3):
            flow = w * vectors[e, k]
            sums[i, k] += flow
            sums[j, k] -= flow


@compiled
def block_product(edges: Ints, matrices: Floats, weights: Floats, diagonal: Floats, x: Floats, product: Floats) -> None:
    """Multiply the symmetric block matrix of the measurements with three columns, without forming it.

    Parameters
    ----------
    edges, matrices, weights
        (m, 2), (m, 3, 3) and (m,): block (i, j) is weight times R_ij, block (j, i) its transpose.
    diagonal
        (n,) factor of the identity in each diagonal block.
    x, product
        (n, 3, 3): the three columns, cut into one block for each camera; `product` is filled.
    """
    for i in range(x.shape[0]):
        for a in range(3):
            for k in range(3):
                product[i, a, k] = diagonal[i] * x[i, a, k]
    for e in range(edges.shape[0]):
        i, j, w = edges[e, 0], edges[e, 1], weights[e]
        for a in range(3):
            to_i = w * matrices[e, a, 0], w * matrices[e, a, 1], w * matrices[e, a, 2]
            to_j = w * matrices[e, 0, a], w * matrices[e, 1, a], w * matrices[e, 2, a]
            for k in range(3):
                product[i, a, k] += to_i[0] * x[j, 0, k] + to_i[1] * x[j, 1, k] + to_i[2] * x[j, 2, k]
                product[j, a, k] += to_j[0] * x[i, 0, k] + to_j[1] * x[i, 1, k] + to_j[2] * x[i, 2, k]


@compiled
def clipped_product(
    edges: Ints, matrices: Floats, left: Floats, right: Floats, threshold: float, x: Floats, product: Floats
) -> None:
    """Multiply the symmetric block matrix of clipped residuals with three columns, without forming it.

    Parameters
    ----------
    edges, matrices
        (m, 2) and (m, 3, 3). Block (i, j) is R_ij - A_i B_j^T, each entry limited to [-threshold, threshold], block
        (j, i) its transpose; block (i, i) likewise with the identity for R_ij.
    left, right
        (n, 3, 3): the A_i and the B_i, with A_i B_j^T = (A_j B_i^T)^T.
    x, product
        (n, 3, 3): the three columns, cut into one block for each camera; `product` is filled.
    """
    product[:] = 0
    for e in range(-x.shape[0], edges.shape[0]):
        i, j = (edges[e, 0], edges[e, 1]) if e >= 0 else (-1 - e, -1 - e)
        for a in range(3):
            for b in range(3):
                measured = matrices[e, a, b] if e >= 0 else (1.0 if a == b else 0.0)
                r = measured - left[i, a, 0] * right[j, b, 0] - left[i, a, 1] * right[j, b, 1]
                r = min(max(r - left[i, a, 2] * right[j, b, 2], -threshold), threshold)
                for k in range(3):
                    product[i, a, k] += r * x[j, b, k]
                    if e >= 0:
                        product[j, b, k] += r * x[i, a, k]
