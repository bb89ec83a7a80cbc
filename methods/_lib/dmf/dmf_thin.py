"""The thin form of deep matrix factorization: only the observed blocks of the product are ever computed."""

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Problem

from ..graph.confidence import strengths

Single = NDArray[np.float32]
Loss = Literal["l1", "l2", "l1/2"]
Report = Callable[[int, float], None]

CHUNK = 64  # neighbours handled together: their blocks stay in the first-level cache
SMALLEST_VALUE = 1e-2  # of a start's singular values, relative to the largest: a factor of zero never grows


@dataclass(frozen=True)
class Observed:
    """The observed blocks of Z, by rows, in both directions and with the identity on the diagonal.

    Parameters
    ----------
    first
        (n + 1,) where the blocks of each camera begin.
    neighbour
        (k,) the other camera of each block, k = 2m + n.
    blocks
        (9, k) the entries of the blocks.
    order
        (k,) which of the edges (0 to m - 1), the edges read backwards (m to 2m - 1) and the identities each block is.
    count
        (n,) number of observed blocks in each camera's row, an edge counting with its `confidence`.
    """

    first: NDArray[np.uint32]
    neighbour: NDArray[np.uint32]
    blocks: Single
    order: NDArray[np.intp]
    count: Floats

    def weigh(self, weights: Floats) -> Single:
        """(k,) weight of each block from those of the edges (m,); the identities have the weight one."""
        identities = np.ones(len(self.count))
        return np.concatenate([weights, weights, identities])[self.order].astype(np.float32)

    @classmethod
    def of(cls, problem: Problem) -> "Observed":
        """Collect the blocks of a problem."""
        n, (i, j), cameras = problem.n, problem.edges.T, np.arange(problem.n)
        rows, columns = np.concatenate([i, j, cameras]), np.concatenate([j, i, cameras])
        order = np.lexsort((columns, rows))
        transposed = np.swapaxes(problem.rotations, -1, -2)
        blocks = np.concatenate([problem.rotations, transposed, np.broadcast_to(np.eye(3), (n, 3, 3))])
        first = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))])
        flat = np.ascontiguousarray(blocks[order].reshape(-1, 9).T, dtype=np.float32)
        return cls(first.astype(np.uint32), columns[order].astype(np.uint32), flat, order, 1 + strengths(problem))


@dataclass
class Factors:
    """A symmetric product D^(1/2) E D^(1/2) = W_d ... W_1 whose last factor is the transpose of the first.

    Parameters
    ----------
    end
        W_d (3n, w); W_1 is its transpose.
    middle
        W_(d-1), ..., W_2, each (w, w); equal to their transposes read backwards.
    """

    end: Single
    middle: list[Single] = field(default_factory=list)

    @classmethod
    def balanced(cls, values: Floats, vectors: Floats, depth: int) -> "Factors":
        """Factors, all with the same singular values, of vectors @ diag(values) @ vectors.T.

        Parameters
        ----------
        values, vectors
            (w,) descending and positive, and (3n, w) orthonormal.
        """
        root = np.maximum(values, SMALLEST_VALUE * values[0]) ** (1 / depth)
        middle = [np.diag(root).astype(np.float32) for _ in range(depth - 2)]
        return cls((vectors * root).astype(np.float32), middle)

    def partial_products(self) -> tuple[list[Single], list[Single]]:
        """Products (w, w) of the middle factors before each, and after each; the last and the first are of all."""
        identity = np.eye(self.end.shape[1], dtype=np.float32)
        before, after = [identity], [identity]
        for factor in self.middle:
            before.append(before[-1] @ factor)
        for factor in reversed(self.middle):
            after.append(factor @ after[-1])
        return before, after[::-1]

    def eigenpairs(self) -> tuple[Floats, Floats]:
        """Eigenvalues (w,) of the product, descending, and their eigenvectors (3n, w)."""
        basis, triangle = np.linalg.qr(self.end.astype(float))
        core = triangle @ self.partial_products()[0][-1].astype(float) @ triangle.T
        values, vectors = np.linalg.eigh((core + core.T) / 2)
        return values[::-1], (basis @ vectors)[:, ::-1]


def chordal(angle_deg: float) -> float:
    """Frobenius distance of two rotations at a small angle."""
    return float(np.sqrt(2) * np.radians(angle_deg))


def descend(
    observed: Observed,
    factors: Factors,
    loss: Loss,
    *,
    lr: float,
    momentum: float,
    iterations: int,
    smoothing: tuple[float, float],
    report: Report | None = None,
    weights: Single | None = None,
) -> float:
    """Gradient descent with momentum on the factors, in place; the step falls to zero along half a cosine.

    With degree-normalised rows the gradient of one camera is an average over its neighbours. Divided by
    k^(1-2/d), k being the number of observed blocks, a step then moves a rotation equally far in any graph
    at any depth d.

    Parameters
    ----------
    lr
        First step, relative.
    smoothing
        First and last scale s of the smoothed losses "l1" and "l1/2", chordal; it falls geometrically.
    report
        Called with the iteration and the loss before every step, and once after the last.
    weights
        (k,) of the observed blocks in the loss, by default ones; `report` may change them in place.

    Returns
    -------
    float
        The loss after the last step: a mean over observed entries, or for "l1/2" over observed blocks.

    Raises
    ------
    FloatingPointError
        When the step is so large that the product diverges.
    """
    count, width = observed.count, factors.end.shape[1]
    n, depth = len(count), len(factors.middle) + 2
    root = np.sqrt(count).astype(np.float32)[:, None]
    first_step = lr / count.sum() ** (1 - 2 / depth)
    sums = np.empty((n, 3 * width), np.float32)
    velocity = [np.zeros_like(f) for f in (factors.end, *factors.middle)]
    kernel = edge_kernel(width, loss)
    for t in range(iterations + 1):
        progress = t / max(iterations, 1)
        scale = smoothing[0] * (smoothing[1] / smoothing[0]) ** progress
        before, after = factors.partial_products()
        left = (factors.end @ before[-1]).reshape(n, -1) / root
        right = factors.end.reshape(n, -1) / root
        graph = observed.first, observed.neighbour, observed.blocks
        cost = kernel(*graph, left, right.T.copy(), np.float32(scale), sums, weights)
        if not np.isfinite(cost):
            raise FloatingPointError(f"the product diverged after {t} iterations; a smaller lr may help")
        if report is not None:
            report(t, cost)
        if t == iterations:
            return float(cost)
        pulled = (sums / root).reshape(3 * n, width)
        core = factors.end.T @ pulled
        gradients = [pulled @ before[-1].T]
        gradients += [before[k].T @ core @ after[k + 1].T for k in range(depth - 2)]
        step = np.float32(first_step * 0.5 * (1 + np.cos(np.pi * progress)))
        for factor, v, gradient in zip((factors.end, *factors.middle), velocity, gradients, strict=True):
            v *= momentum
            v += gradient
            factor -= step * v
    raise AssertionError("unreachable")


@functools.cache
def edge_kernel(width: int, loss: Loss) -> Callable[..., float]:
    """Compile the loop over observed blocks for one width and one loss; kept on disk by numba.

    The function takes (first, neighbour, blocks, left (n, 3w), right (3w, n), s, sums (n, 3w), and the weights (k,)
    of the blocks or nothing). It fills ``sums`` with G @ right, where G is the gradient of the loss with respect to
    E, and returns the mean loss.
    With the residual r = left_i right_j^T - R_ij, the block of G is r / (r^2 + s^2)^(1/2) entry by entry for
    "l1", r for "l2", and s^(1/2) r / (|r|^2 + s^2)^(3/4) for "l1/2".
    """
    import numba

    size = 3 * width

    @numba.njit(cache=True, fastmath=True, nogil=True, error_model="numpy")
    def kernel(
        first: Any, neighbour: Any, blocks: Any, left: Any, right: Any, scale: Any, sums: Any, weights: Any = None
    ) -> float:
        near = np.empty((size, CHUNK), np.float32)
        residual = np.empty((9, CHUNK), np.float32)
        square = np.empty(CHUNK, np.float32)
        total = np.float64(0)
        for i in range(left.shape[0]):
            for q in range(size):
                sums[i, q] = 0
            for begin in range(first[i], first[i + 1], CHUNK):
                length = min(CHUNK, first[i + 1] - begin)
                for q in range(size):
                    for k in range(length):
                        near[q, k] = right[q, neighbour[begin + k]]
                for k in range(length):
                    square[k] = 0
                for ab in range(9):
                    row, column = width * (ab // 3), width * (ab % 3)
                    for k in range(length):
                        residual[ab, k] = -blocks[ab, begin + k]
                    for c in range(width):
                        factor = left[i, row + c]
                        for k in range(length):
                            residual[ab, k] += factor * near[column + c, k]
                    if loss == "l1":
                        for k in range(length):
                            smooth = np.sqrt(residual[ab, k] * residual[ab, k] + scale * scale)
                            square[k] += smooth
                            residual[ab, k] /= smooth
                    else:
                        for k in range(length):
                            square[k] += residual[ab, k] * residual[ab, k]
                if loss == "l1/2":
                    for k in range(length):
                        root = np.sqrt(np.sqrt(square[k] + scale * scale))
                        factor = np.sqrt(scale) / (root * root * root)
                        square[k] = root
                        for ab in range(9):
                            residual[ab, k] *= factor
                if weights is not None:
                    for k in range(length):
                        square[k] *= weights[begin + k]
                        for ab in range(9):
                            residual[ab, k] *= weights[begin + k]
                part = np.float32(0)
                for k in range(length):
                    part += square[k]
                total += part
                for ab in range(9):
                    row, column = width * (ab // 3), width * (ab % 3)
                    for c in range(width):
                        part = np.float32(0)
                        for k in range(length):
                            part += residual[ab, k] * near[column + c, k]
                        sums[i, row + c] += part
        return total / (len(neighbour) * (1 if loss == "l1/2" else 9))

    return kernel
