"""Loops over the edges and the cameras of a graph, compiled by numba.

A kernel is compiled at its first call and cached on disk, so that importing this module costs nothing.
The kernels write into the arrays given last. Rotations are unit quaternions (w, x, y,
z), or matrices where named so.
"""

import functools
import math
from collections.abc import Callable
from typing import ParamSpec

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Ints

P = ParamSpec("P")
Singles = NDArray[np.float32]
FAST = {"reassoc", "nsz", "arcp", "contract", "afn"}  # what lets loops use vector registers; not NaN and infinity
CHUNK = 128  # edges handled together, so that the arithmetic is one vector loop over gathered operands

# arctan(t) / t in powers of t^2, highest first, interpolated to 1e-16 for |t| <= tan(pi / 8)
ARCTAN = (
    0.021135408585107242,
    -0.04348054418574519,
    0.05688349682245908,
    -0.06640233942217895,
    0.0768995348655139,
    -0.09090773073096557,
    0.11111106180324258,
    -0.14285714180971215,
    0.19999999998855003,
    -0.33333333333328435,
    1.0,
)


def compiled(loop: Callable[P, None]) -> Callable[P, None]:
    @functools.cache
    def machine_code() -> Callable[P, None]:
        import numba

        return numba.njit(cache=True, fastmath=FAST, error_model="numpy")(loop)

    @functools.wraps(loop)
    def call(*args: P.args, **kwargs: P.kwargs) -> None:
        machine_code()(*args, **kwargs)

    return call


@compiled
def quaternions(matrices: Floats, result: Floats) -> None:
    """Unit quaternions (m, 4), filled, of rotation matrices (m, 3, 3): the largest component by its square root."""
    for e in range(matrices.shape[0]):
        a, b, c = matrices[e, 0, 0], matrices[e, 1, 1], matrices[e, 2, 2]
        x, y, z = matrices[e, 2, 1], matrices[e, 0, 2], matrices[e, 1, 0]
        u, v, t = matrices[e, 1, 2], matrices[e, 2, 0], matrices[e, 0, 1]
        if a + b + c > 0:
            q = 1 + a + b + c, x - u, y - v, z - t
        elif a >= b and a >= c:
            q = x - u, 1 + a - b - c, z + t, y + v
        elif b >= c:
            q = y - v, z + t, 1 + b - a - c, x + u
        else:
            q = z - t, y + v, x + u, 1 + c - a - b
        scale = 1 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        for k in range(4):
            result[e, k] = scale * q[k]


@compiled
def edge_residuals(edges: Ints, measured: Floats, cameras: Floats, vectors: Floats, angles: Floats) -> None:
    """Rotation vectors of R_i^T R_ij R_j, the residual of each edge seen in the world frame.

    The angle is eight times the arctangent of the tangent of an eighth of it, which two half-angle formulas
    give from the sine and cosine of its half; no branch, no library call, accurate to the last digits from 0 to pi.

    Parameters
    ----------
    edges
        (m, 2).
    measured, cameras
        (m, 4) and (n, 4): R_ij and R_i.
    vectors, angles
        Filled with the rotation vectors (m, 3) and their norms (m,) in [0, pi], radians.
    """
    m = edges.shape[0]
    chunk = np.empty((12, CHUNK))
    for first in range(0, m, CHUNK):
        size = min(CHUNK, m - first)
        for k in range(size):
            i, j = edges[first + k, 0], edges[first + k, 1]
            for r in range(4):
                chunk[r, k] = cameras[i, r]
                chunk[4 + r, k] = measured[first + k, r]
                chunk[8 + r, k] = cameras[j, r]
        for k in range(size):
            w, x, y, z = chunk[0, k], -chunk[1, k], -chunk[2, k], -chunk[3, k]
            a, b, c, d = chunk[4, k], chunk[5, k], chunk[6, k], chunk[7, k]
            w, x, y, z = (
                w * a - x * b - y * c - z * d,
                w * b + x * a + y * d - z * c,
                w * c - x * d + y * a + z * b,
                w * d + x * c - y * b + z * a,
            )
            a, b, c, d = chunk[8, k], chunk[9, k], chunk[10, k], chunk[11, k]
            cosine = w * a - x * b - y * c - z * d
            u = w * b + x * a + y * d - z * c
            v = w * c - x * d + y * a + z * b
            t = w * d + x * c - y * b + z * a
            sine = math.sqrt(u * u + v * v + t * t)
            above = 1 + abs(cosine)
            inverse = 1 / (above + math.sqrt(above * above + sine * sine))
            square = (sine * inverse) ** 2
            series = 0.0
            for coefficient in ARCTAN:
                series = series * square + coefficient
            scale = 8 * inverse * series
            chunk[3, k] = scale * sine
            scale = math.copysign(scale, cosine)
            chunk[0, k], chunk[1, k], chunk[2, k] = scale * u, scale * v, scale * t
        for k in range(size):
            for r in range(3):
                vectors[first + k, r] = chunk[r, k]
            angles[first + k] = chunk[3, k]


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
def turn(steps: Floats, cameras: Floats) -> None:
    """Replace R_i by R_i exp(x_i), normalised: `cameras` (n, 4) in place, the x_i (n, 3) being `steps`."""
    for i in range(cameras.shape[0]):
        x, y, z = steps[i, 0], steps[i, 1], steps[i, 2]
        angle = math.sqrt(x * x + y * y + z * z)
        scale = math.sin(angle / 2) / angle if angle > 0 else 0.5
        w, x, y, z = math.cos(angle / 2), scale * x, scale * y, scale * z
        a, b, c, d = cameras[i, 0], cameras[i, 1], cameras[i, 2], cameras[i, 3]
        q = (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        )
        norm = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        for k in range(4):
            cameras[i, k] = q[k] / norm


@compiled
def laplacian_product(edges: Ints, weights: Singles, degrees: Singles, x: Singles, product: Singles) -> None:
    """Multiply a weighted graph Laplacian with four columns, without forming it.

    Parameters
    ----------
    edges, weights, degrees
        (m, 2), (m,) and (n,): the sums of the weights at each camera.
    x, product
        (n, 4): one vector register holds a row; `product` is filled.
    """
    for i in range(x.shape[0]):
        for k in range(4):
            product[i, k] = degrees[i] * x[i, k]
    for e in range(edges.shape[0]):
        i, j, w = edges[e, 0], edges[e, 1], weights[e]
        for k in range(4):
            product[i, k] -= w * x[j, k]
            product[j, k] -= w * x[i, k]


@compiled
def banded_laplacian(places: Ints, weights: Floats, degrees: Floats, rows: Floats) -> None:
    """Add a weighted graph Laplacian to the rows of its lower band, for LAPACK: entry (i, j) at ``rows[j, i - j]``.

    Parameters
    ----------
    places, weights
        (m, 2) and (m,): the row of each end of an edge, -1 for a camera that has none.
    degrees
        (k,): the sums of the weights at each camera.
    rows
        (k, b), zeros.
    """
    for i in range(len(degrees)):
        rows[i, 0] = degrees[i]
    for e in range(len(places)):
        low, high = min(places[e, 0], places[e, 1]), max(places[e, 0], places[e, 1])
        if low >= 0:
            rows[low, high - low] -= weights[e]


@compiled
def dense_laplacian(edges: Ints, weights: Floats, degrees: Floats, matrix: Floats) -> None:
    """Fill the upper triangle of a weighted graph Laplacian without its last row and column.

    Parameters
    ----------
    edges, weights, degrees
        (m, 2), (m,) and (n,): the sums of the weights at each camera.
    matrix
        (n - 1, n - 1); the lower triangle is set to zero.
    """
    size = matrix.shape[0]
    matrix[:] = 0
    for i in range(size):
        matrix[i, i] = degrees[i]
    for e in range(edges.shape[0]):
        i, j = edges[e, 0], edges[e, 1]
        if j < size:
            matrix[i, j] -= weights[e]


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
        a, b, c = w * matrices[e, 0, 0], w * matrices[e, 0, 1], w * matrices[e, 0, 2]
        d, f, g = w * matrices[e, 1, 0], w * matrices[e, 1, 1], w * matrices[e, 1, 2]
        p, q, r = w * matrices[e, 2, 0], w * matrices[e, 2, 1], w * matrices[e, 2, 2]
        for k in range(3):
            u, v, t = x[j, 0, k], x[j, 1, k], x[j, 2, k]
            y, z, s = x[i, 0, k], x[i, 1, k], x[i, 2, k]
            product[i, 0, k] += a * u + b * v + c * t
            product[i, 1, k] += d * u + f * v + g * t
            product[i, 2, k] += p * u + q * v + r * t
            product[j, 0, k] += a * y + d * z + p * s
            product[j, 1, k] += b * y + f * z + q * s
            product[j, 2, k] += c * y + g * z + r * s


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
