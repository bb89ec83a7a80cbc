"""Batched maths on SO(3).

Rotations are arrays of shape (..., 3, 3), rotation vectors (axis times angle) of shape (..., 3);
leading dimensions broadcast. Angles are radians.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MEAN_TOLERANCE = 1e-12  # radians; far below what any measurement resolves
MEAN_ITERATIONS = 200
MEDIAN_STARTS = 32


def hat(v: Array) -> Array:
    """Skew-symmetric matrices (..., 3, 3) with ``hat(v) @ x == cross(v, x)``."""
    v = np.asarray(v, dtype=float)
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def vee(m: Array) -> Array:
    """Axial vectors (..., 3) of the skew-symmetric part of matrices; the inverse of `hat`."""
    return 0.5 * np.stack(
        [m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], axis=-1
    )


def exp(v: Array) -> Array:
    """Rotations (..., 3, 3) from rotation vectors (..., 3), by Rodrigues' formula."""
    v = np.asarray(v, dtype=float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    k = hat(v)
    half = np.sinc(angle / (2 * np.pi))
    return np.eye(3) + np.sinc(angle / np.pi) * k + 0.5 * half**2 * (k @ k)


def log(r: Array) -> Array:
    """Rotation vectors (..., 3) of rotations, with norms in [0, pi]; accurate at both ends."""
    q = to_quaternion(r)
    sine = np.linalg.norm(q[..., 1:], axis=-1)
    angle = 2 * np.arctan2(sine, q[..., 0])
    scale = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0)
    return scale[..., None] * q[..., 1:]


def to_quaternion(r: Array) -> Array:
    """Unit quaternions (..., 4), scalar first and not negative.

    Of the four algebraically equal columns of the matrix 4 q q^T, each written with entries of r, the one
    with the largest diagonal entry is normalised, so that no accuracy is lost near any angle.
    """
    r = np.asarray(r, dtype=float)
    m = np.empty((*r.shape[:-2], 4, 4))
    diagonal = np.diagonal(r, axis1=-2, axis2=-1)
    trace = diagonal.sum(axis=-1)
    m[..., 0, 0] = 1 + trace
    m[..., 0, 1:] = m[..., 1:, 0] = 2 * vee(r)
    m[..., 1:, 1:] = r + np.swapaxes(r, -1, -2)
    for k in range(3):
        m[..., k + 1, k + 1] = 1 - trace + 2 * diagonal[..., k]
    largest = np.argmax(np.diagonal(m, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(m, largest[..., None, None], axis=-1)[..., 0]
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0, -q, q)


def from_quaternion(q: Array) -> Array:
    """Rotations (..., 3, 3) from quaternions (..., 4), scalar first, of any non-zero norm."""
    q = np.asarray(q, dtype=float)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    w, v = q[..., :1, None], q[..., 1:]
    outer = v[..., :, None] * v[..., None, :]
    square = np.sum(v * v, axis=-1)[..., None, None]
    return (w * w - square) * np.eye(3) + 2 * outer + 2 * w * hat(v)


def project(m: Array) -> Array:
    """Nearest rotations (..., 3, 3) in the Frobenius norm, by SVD with the determinant fixed to +1."""
    u, _, vt = np.linalg.svd(m)
    flip = np.linalg.det(u @ vt) < 0
    u[..., :, 2] = np.where(flip[..., None], -u[..., :, 2], u[..., :, 2])
    return u @ vt


def angle(r: Array) -> Array:
    """Rotation angles (...) in [0, pi], from atan2 of sine and cosine.

    Unlike the arccos of the trace this resolves angles down to the rounding of the entries and is never NaN
    for a rotation.
    """
    r = np.asarray(r, dtype=float)
    sine = np.linalg.norm(vee(r), axis=-1)
    cosine = 0.5 * (np.trace(r, axis1=-2, axis2=-1) - 1)
    return np.arctan2(sine, cosine)


def angle_between(a: Array, b: Array) -> Array:
    """Geodesic distances (...) in [0, pi] between rotations."""
    return angle(a @ np.swapaxes(b, -1, -2))


def from_euler(angles: Array) -> Array:
    """Rotations Rz(c) Ry(b) Rx(a) from Euler angles (..., 3) = (a, b, c)."""
    angles = np.asarray(angles, dtype=float)
    x, y, z = (exp(angles[..., k, None] * np.eye(3)[k]) for k in range(3))
    return z @ y @ x


def random(rng: np.random.Generator, size: int) -> Array:
    """Haar-uniform rotations (size, 3, 3)."""
    return from_quaternion(rng.standard_normal((size, 4)))


def random_axes(rng: np.random.Generator, size: int) -> Array:
    """Unit vectors (size, 3), uniform on the sphere."""
    v = rng.standard_normal((size, 3))
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def chordal_mean(r: Array) -> Array:
    """Rotation (3, 3) that minimises the sum of squared chordal distances to r (k, 3, 3)."""
    return project(r.mean(axis=0))


def karcher_mean(r: Array) -> Array:
    """Rotation (3, 3) that minimises the sum of squared geodesic distances to r (k, 3, 3).

    Gradient descent with unit step (Manton 2004), from the chordal mean.
    """
    mean = chordal_mean(r)
    for _ in range(MEAN_ITERATIONS):
        step = log(r @ mean.T).mean(axis=0)
        mean = exp(step) @ mean
        if np.linalg.norm(step) < MEAN_TOLERANCE:
            break
    return mean


def geodesic_median(r: Array) -> Array:
    """Rotations (..., 3, 3) that minimise the sum of geodesic distances to r (..., k, 3, 3).

    Weiszfeld's iteration on the tangent space (Hartley, Aftab and Trumpf 2011), with the step of Vardi and
    Zhang (2000) where the iterate meets a member: there the plain step is 0/0, and stops whether or not the
    member is the median. The problem is not convex: the start is the cheapest of the geometric median in R^9
    (a convex problem), projected, and up to `MEDIAN_STARTS` evenly spaced members. Nothing depends on the
    frame. Many sets of the same size are solved together, each as it would be alone.
    """
    sets = r.reshape(-1, *r.shape[-3:])
    members = sets[:, np.unique(np.linspace(0, sets.shape[1] - 1, MEDIAN_STARTS).astype(int))]
    starts = np.concatenate([project(_geometric_median(sets))[:, None], members], axis=1)
    costs = angle_between(starts[:, :, None], sets[:, None]).sum(axis=2)
    median = to_quaternion(starts[np.arange(len(sets)), np.argmin(costs, axis=1)])
    q = to_quaternion(sets)
    going = np.arange(len(sets))
    for _ in range(MEAN_ITERATIONS):
        relative = q[going] @ _right_product(median[going] * _CONJUGATE)
        sine = np.linalg.norm(relative[..., 1:], axis=2)
        distance = 2 * np.arctan2(sine, np.abs(relative[..., 0]))
        met = distance < MEAN_TOLERANCE
        weight = np.divide(1, distance, out=np.zeros_like(distance), where=~met)
        unit = np.divide(np.copysign(1, relative[..., 0]), sine, out=np.zeros_like(sine), where=~met)
        pull = np.einsum("sk,skj->sj", unit, relative[..., 1:])
        length = np.linalg.norm(pull, axis=1)
        excess = length - met.sum(axis=1)
        moving = excess > 0
        going, pull, length = going[moving], pull[moving], length[moving]
        step = excess[moving] / weight.sum(axis=1)[moving]
        turn = np.column_stack([np.cos(step / 2), (np.sin(step / 2) / length)[:, None] * pull])
        median[going] = (turn[:, None] @ _right_product(median[going]))[:, 0]
        going = going[step >= MEAN_TOLERANCE]
        if not len(going):
            break
    return from_quaternion(median).reshape(*r.shape[:-3], 3, 3)


_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_ENTRY = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
_SIGN = np.array([[1, 1, 1, 1], [-1, 1, -1, 1], [-1, 1, 1, -1], [-1, -1, 1, 1]])


def _right_product(q: Array) -> Array:
    """Matrices (..., 4, 4) with p @ them the Hamilton products p q of quaternions."""
    product: Array = q[..., _ENTRY] * _SIGN
    return product


def _geometric_median(r: Array) -> Array:
    """Matrices (s, 3, 3) that minimise the sum of Frobenius distances to r (s, k, 3, 3), to 1e-6 (Weiszfeld)."""
    entries = r.reshape(*r.shape[:2], 9)
    center: Array = entries.mean(axis=1)
    going = np.arange(len(r))
    for _ in range(MEAN_ITERATIONS):
        own = entries[going]
        weight = 1 / np.maximum(np.linalg.norm(own - center[going, None], axis=2), MEAN_TOLERANCE)
        moved = np.einsum("sk,skj->sj", weight, own) / weight.sum(axis=1, keepdims=True)
        step = np.linalg.norm(moved - center[going], axis=1)
        center[going] = moved
        going = going[step >= 1e-6]
        if not len(going):
            break
    return center.reshape(-1, 3, 3)
