"""What a method sees (`Problem`), what a dataset yields (`Instance`), what a method returns (`Estimate`).

The convention, everywhere: R_ij = R_i R_j^T for every measured edge (i, j), where R_i maps world to camera.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.errors import InputError

if TYPE_CHECKING:
    from scipy import sparse

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

ROTATION_TOLERANCE = 1e-6
_LARGEST = 1e6  # the entries of a rotation are at most 1; larger ones still may not overflow a determinant
MOST_CAMERAS = 10_000_000  # so that a damaged number does not take all memory


class Skipped(Exception):  # noqa: N818 - an outcome, not an error
    """Raised by `Method.solve` to decline a problem; the message becomes the row ``skipped(message)``."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Relative rotations measured on the edges of a graph of cameras.

    Parameters
    ----------
    n
        Number of cameras.
    edges
        (m, 2), i < j, no pair twice.
    rotations
        (m, 3, 3), R_ij = R_i R_j^T. Matrices that are further than 1e-6 (Frobenius) from SO(3) are replaced by the
        nearest rotation, with one warning that counts them.
    weights
        (m,) positive, such as match counts, or None.

    All arrays are copied to contiguous memory and made read-only.

    Raises
    ------
    InputError
        On shapes that do not fit, ids outside the graph, self edges, reversed or duplicate edges, values
        that are not finite, reflections (determinant below zero), or an empty graph.
    """

    n: int
    edges: Ints
    rotations: Floats
    weights: Floats | None = None

    def __post_init__(self) -> None:
        edges = _checked_edges(self.n, self.edges)
        rotations = _checked_rotations(edges, self.rotations)
        weights = None if self.weights is None else _checked_weights(edges, self.weights)
        for name, value in (("edges", edges), ("rotations", rotations), ("weights", weights)):
            if value is not None:
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def m(self) -> int:
        """Number of edges."""
        return len(self.edges)

    @cached_property
    def degree(self) -> Ints:
        """(n,) number of edges at each camera."""
        return _frozen(np.bincount(self.edges.ravel(), minlength=self.n).astype(np.int32))

    @cached_property
    def components(self) -> Ints:
        """(n,) label of the connected component of each camera; 0 is the largest component."""
        from scipy import sparse
        from scipy.sparse.csgraph import connected_components

        graph = sparse.coo_array((np.ones(self.m), tuple(self.edges.T)), shape=(self.n, self.n))
        _, labels = connected_components(graph, directed=False)
        sizes = np.bincount(labels)
        rank = np.empty_like(sizes)
        rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
        return _frozen(rank[labels].astype(np.int32))

    def adjacency(self, values: Floats | None = None) -> "sparse.csr_array":
        """Symmetric (n, n) CSR matrix with `values` (m,), by default ones, on the edges."""
        from scipy import sparse

        i, j = self.edges.T
        values = np.ones(self.m) if values is None else values
        upper = sparse.coo_array((values, (i, j)), shape=(self.n, self.n)).tocsr()
        return upper + upper.T

    def laplacian(self, values: Floats | None = None) -> "sparse.csr_array":
        """Graph Laplacian (n, n) CSR, the edges weighted by `values` (m,), by default ones."""
        from scipy import sparse

        adjacency = self.adjacency(values)
        return sparse.diags_array(adjacency.sum(axis=1)).tocsr() - adjacency

    def block_matrix(self, values: Floats | None = None, diagonal: Floats | None = None) -> "sparse.csr_array":
        """Symmetric (3n, 3n) CSR matrix of the measurements: block (i, j) is R_ij times a value, (j, i) its transpose.

        Parameters
        ----------
        values
            (m,) weight of each block; by default ones.
        diagonal
            (n,) factor of the identity in each diagonal block; by default none.
        """
        from scipy import sparse

        i, j = self.edges.T
        blocks = self.rotations if values is None else values[:, None, None] * self.rotations
        rows = 3 * i[:, None, None] + np.arange(3)[:, None] + np.zeros((1, 1, 3), np.int32)
        cols = 3 * j[:, None, None] + np.arange(3) + np.zeros((1, 3, 1), np.int32)
        size = 3 * self.n
        upper = sparse.coo_array((blocks.ravel(), (rows.ravel(), cols.ravel())), shape=(size, size)).tocsr()
        full = upper + upper.T
        return full if diagonal is None else full + sparse.diags_array(np.repeat(diagonal, 3)).tocsr()

    def residuals(self, rotations: Floats) -> Floats:
        """(m,) angles in radians between R_ij and R_i R_j^T; NaN where a camera is not solved.

        Parameters
        ----------
        rotations
            (n, 3, 3) absolute rotations.
        """
        i, j = self.edges.T
        return so3.angle_between(self.rotations, rotations[i] @ np.swapaxes(rotations[j], -1, -2))

    def subgraph(self, cameras: NDArray[np.integer[Any]]) -> "tuple[Problem, NDArray[np.bool_]]":
        """Problem on `cameras` (k,) alone, relabelled 0..k-1 in the order given, and the (m,) mask of edges kept.

        An edge whose ends change order is reversed and its rotation transposed.
        """
        label = np.full(self.n, -1, dtype=np.int32)
        label[cameras] = np.arange(len(cameras), dtype=np.int32)
        kept: NDArray[np.bool_] = np.all(label[self.edges] >= 0, axis=1)
        edges, rotations = oriented(label[self.edges[kept]], self.rotations[kept])
        weights = None if self.weights is None else self.weights[kept]
        return Problem(len(cameras), edges, rotations, weights), kept


@dataclass(frozen=True, eq=False)
class Instance:
    """A problem with what is known of its solution.

    Parameters
    ----------
    problem
        What a method is given.
    truth
        (n, 3, 3), NaN where unknown; None where nothing is known.
    outliers
        (m,) True on edges whose measurement is an outlier; None unless simulated.
    name
        Name of the instance within its dataset.
    protocol
        Which cameras are solved and scored.
    source
        Where it comes from, in words.
    revision
        Hash of the files or of the generator it was made from.
    notes
        What a reader of a table must know of it.
    statistics
        What the paper's Table I prints of the scene, such as ``edges_percent`` and ``hardness``.
    """

    problem: Problem
    truth: Floats | None
    name: str
    outliers: NDArray[np.bool_] | None = None
    protocol: str = "all"
    source: str = ""
    revision: str = ""
    notes: tuple[str, ...] = ()
    statistics: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """The state of an iterative method at one moment.

    Parameters
    ----------
    iteration, seconds
        When; seconds since `solve` was entered.
    rotations
        (n, 3, 3).
    diagnostics
        Named scalars, such as leading singular values.
    """

    iteration: int
    seconds: float
    rotations: Floats
    diagnostics: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a method found.

    Parameters
    ----------
    rotations
        (n, 3, 3) absolute rotations; NaN where a camera was not solved.
    edge_weights
        (m,) how much each edge was believed at the end, or None.
    iterations
        How many were done, or None.
    stop_reason
        Why it ended, in words.
    cost
        The method's own objective at the end, or None.
    certificate
        Smallest eigenvalue of the certificate matrix (optimal when it is not below zero up to tolerance), or None.
    checkpoints
        For curves over iterations.
    conversion_s
        Seconds of `solve` that went into converting to and from a library's own types. The time in tables is
        without them; they are stored beside it.
    notes
        Every fallback taken, and what else a reader of the row must know.
    """

    rotations: Floats
    edge_weights: Floats | None = None
    iterations: int | None = None
    stop_reason: str = ""
    cost: float | None = None
    certificate: float | None = None
    checkpoints: tuple[Checkpoint, ...] = ()
    conversion_s: float = 0.0
    notes: tuple[str, ...] = ()


def oriented(edges: NDArray[np.integer[Any]], rotations: Floats) -> tuple[Ints, Floats]:
    """Edges (m, 2) with i < j, and their rotations (m, 3, 3): transposed where an edge had to be reversed."""
    reverse = edges[:, 0] > edges[:, 1]
    flipped = np.where(reverse[:, None], edges[:, ::-1], edges).astype(np.int32)
    return flipped, np.where(reverse[:, None, None], np.swapaxes(rotations, -1, -2), rotations)


def _frozen(array: Ints) -> Ints:
    array.setflags(write=False)
    return array


def _checked_edges(n: int, edges: Any) -> Ints:
    if n < 1:
        raise InputError("the graph has no cameras")
    if n > MOST_CAMERAS:
        raise InputError(f"the graph claims {n} cameras, and at most {MOST_CAMERAS} can be handled")
    given = np.asarray(edges)
    if given.ndim != 2 or given.shape[1] != 2:
        raise InputError(f"edges must have shape (m, 2), not {given.shape}")
    if len(given) == 0:
        raise InputError("the graph has no edges")
    if given.dtype.kind not in "iu":
        raise InputError(f"edges must be whole numbers, not {given.dtype}")
    if (bad := (given < 0) | (given >= n)).any():
        row = int(np.flatnonzero(bad.any(axis=1))[0])
        raise InputError(f"edge {row} is {_pair(given[row])}, but camera ids go from 0 to {n - 1}")
    out = np.array(given, dtype=np.int32, order="C")
    if (bad := out[:, 0] == out[:, 1]).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(f"edge {row} is {_pair(out[row])}: a camera with itself")
    if (bad := out[:, 0] > out[:, 1]).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(f"edge {row} is {_pair(out[row])}: edges must have i < j")
    key = out[:, 0].astype(np.int64) * n + out[:, 1]
    order = np.argsort(key, kind="stable")
    if (bad := np.diff(key[order]) == 0).any():
        row = int(order[np.flatnonzero(bad)[0] + 1])
        raise InputError(f"edge {row} is {_pair(out[row])}, which is there already")
    return out


def _checked_rotations(edges: Ints, rotations: Any) -> Floats:
    given = np.asarray(rotations)
    if given.dtype.kind not in "iuf":
        raise InputError(f"rotations must be numbers, not {given.dtype}")
    if given.shape != (len(edges), 3, 3):
        raise InputError(f"rotations must have shape ({len(edges)}, 3, 3), not {given.shape}")
    out = np.array(given, dtype=np.float64, order="C")
    if (bad := ~np.isfinite(out).all(axis=(1, 2))).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(f"the rotation of edge {row} {_pair(edges[row])} is not finite")
    if (bad := (abs(out) > _LARGEST).any(axis=(1, 2))).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(
            f"the rotation of edge {row} {_pair(edges[row])} has an entry of size {abs(out[row]).max():.3g}"
        )
    if (bad := np.linalg.det(out) <= 0).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(
            f"the rotation of edge {row} {_pair(edges[row])} has determinant {np.linalg.det(out[row]):.3g}, "
            "but a rotation has +1"
        )
    off = np.linalg.norm(out @ np.swapaxes(out, -1, -2) - np.eye(3), axis=(1, 2)) > ROTATION_TOLERANCE
    if off.any():
        warnings.warn(
            f"{off.sum()} of {len(out)} relative rotations were not in SO(3) to {ROTATION_TOLERANCE:g} "
            "and were replaced by the nearest rotation",
            stacklevel=4,
        )
        out[off] = so3.project(out[off])
    return out


def _checked_weights(edges: Ints, weights: Any) -> Floats:
    given = np.asarray(weights)
    if given.dtype.kind not in "iuf":
        raise InputError(f"weights must be numbers, not {given.dtype}")
    if given.shape != (len(edges),):
        raise InputError(f"weights must have shape ({len(edges)},), not {given.shape}")
    out = np.array(given, dtype=np.float64, order="C")
    if (bad := ~(np.isfinite(out) & (out > 0))).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(f"the weight of edge {row} {_pair(edges[row])} is {out[row]:g}, not a positive number")
    return out


def _pair(edge: Ints) -> str:
    return f"({edge[0]}, {edge[1]})"
