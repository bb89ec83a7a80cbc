"""What a method sees (`Problem`), what a dataset yields (`Instance`), what a method returns (`Estimate`).

The convention, everywhere: R_ij = R_i R_j^T for every measured edge (i, j), where R_i maps world to camera.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from bench.core import so3
from bench.core.checks import (
    MOST_CAMERAS,
    ROTATION_TOLERANCE,
    Floats,
    Ints,
    checked_edges,
    checked_gravity,
    checked_precisions,
    checked_rotations,
    checked_weights,
)
from bench.core.errors import InputError, shown

if TYPE_CHECKING:
    from scipy import sparse

__all__ = ["MOST_CAMERAS", "ROTATION_TOLERANCE", "Floats", "Ints"]  # beside what is defined here

WeightsKind = Literal["count", "precision"]
Information = Literal["weights", "precisions", "gravity"]
INFORMATION: tuple[Information, ...] = ("weights", "precisions", "gravity")  # what may come with the measurements


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
        (m, 2), i < j. A pair may be measured several times: parallel edges.
    rotations
        (m, 3, 3), R_ij = R_i R_j^T. Matrices that are further than 1e-6 (Frobenius) from SO(3) are replaced by the
        nearest rotation, with one warning that counts them.
    weights
        (m,) positive: how far each measurement is to be trusted, relative to the others; or None.
    weights_kind
        What they are: "count", such as matches, or "precision", inverse squares of the noise's scale.
    precisions
        (m, 3, 3) inverse covariances, in rad^-2 up to one scale, of d in R_ij = exp(d) R_i R_j^T, in frame i; or None.
    gravity
        (n, 3) direction of gravity in the axes of each camera, made unit vectors; NaN where unknown; or None.

    All arrays are copied to contiguous memory and made read-only.

    Raises
    ------
    InputError
        On shapes that do not fit, ids outside the graph, self edges, reversed edges, values that are not finite,
        reflections (determinant below zero), or an empty graph.
    """

    n: int
    edges: Ints
    rotations: Floats
    weights: Floats | None = None
    weights_kind: WeightsKind = "precision"
    precisions: Floats | None = None
    gravity: Floats | None = None

    def __post_init__(self) -> None:
        edges = checked_edges(self.n, self.edges)
        checked: dict[str, Floats | Ints | None] = {
            "edges": edges,
            "rotations": checked_rotations(edges, self.rotations),
            "weights": None if self.weights is None else checked_weights(edges, self.weights),
            "precisions": None if self.precisions is None else checked_precisions(edges, self.precisions),
            "gravity": None if self.gravity is None else checked_gravity(self.n, self.gravity),
        }
        if self.weights_kind not in get_args(WeightsKind):
            raise InputError(f"weights_kind is {shown(self.weights_kind)}; it must be 'count' or 'precision'")
        for name, value in checked.items():
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
        precisions = None if self.precisions is None else self.precisions[kept]
        edges, rotations, precisions = reoriented(label[self.edges[kept]], self.rotations[kept], precisions)
        weights = None if self.weights is None else self.weights[kept]
        gravity = None if self.gravity is None else self.gravity[cameras]
        kind = self.weights_kind
        return Problem(len(cameras), edges, rotations, weights, kind, precisions, gravity), kept

    @property
    def carries(self) -> frozenset[Information]:
        """What came with the measurements."""
        return frozenset(name for name in INFORMATION if getattr(self, name) is not None)

    def keeping(self, names: Collection[Information]) -> "Problem":
        """The problem with none of what came with the measurements but this."""
        absent: dict[str, Any] = dict.fromkeys(self.carries - set(names))
        return replace(self, **absent) if absent else self

    @cached_property
    def relative_weights(self) -> Floats:
        """(m,) weights with mean one; ones where there are none."""
        weights = np.ones(self.m) if self.weights is None else self.weights / self.weights.mean()
        weights.setflags(write=False)
        return weights

    @cached_property
    def has_parallel_edges(self) -> bool:
        """Whether a pair is measured more than once."""
        return len(np.unique(self.edges[:, 0].astype(np.int64) * self.n + self.edges[:, 1])) < self.m


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
    coherent
        (m,) True on outliers that agree with each other, such as those of a repeated facade; None unless simulated.
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
    ids
        (n,) what the files call the cameras; None where they are numbered.
    collection
        What it is one of many of, over which a table may take means; empty where it stands for itself.
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
    ids: NDArray[np.int64] | None = None
    collection: str = ""
    coherent: NDArray[np.bool_] | None = None


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
    camera_sigma
        (n,) angle in radians below which the method expects the error of a camera with probability 68 %, and below
        twice which with 95 %; or None.
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
    camera_sigma: Floats | None = None
    iterations: int | None = None
    stop_reason: str = ""
    cost: float | None = None
    certificate: float | None = None
    checkpoints: tuple[Checkpoint, ...] = ()
    conversion_s: float = 0.0
    notes: tuple[str, ...] = ()


def oriented(edges: NDArray[np.integer[Any]], rotations: Floats) -> tuple[Ints, Floats]:
    """Edges (m, 2) with i < j, and their rotations (m, 3, 3): transposed where an edge had to be reversed."""
    edges, rotations, _ = reoriented(edges, rotations, None)
    return edges, rotations


def reoriented(
    edges: NDArray[np.integer[Any]], rotations: Floats, precisions: Floats | None
) -> tuple[Ints, Floats, Floats | None]:
    """`oriented`, with the precisions (m, 3, 3): R_ij = exp(d) R_i R_j^T gives R_ji = exp(-R_ji d) R_j R_i^T."""
    reverse = edges[:, 0] > edges[:, 1]
    flipped = np.where(reverse[:, None], edges[:, ::-1], edges).astype(np.int32)
    transposed = np.swapaxes(rotations, -1, -2)
    if precisions is not None:
        precisions = np.where(reverse[:, None, None], transposed @ precisions @ rotations, precisions)
    return flipped, np.where(reverse[:, None, None], transposed, rotations), precisions


def _frozen(array: Ints) -> Ints:
    array.setflags(write=False)
    return array
