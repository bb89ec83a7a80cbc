"""Graphs as NumPy archives."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core.errors import InputError
from bench.core.problem import MOST_CAMERAS, Ints
from bench.formats import archive
from bench.formats.graph import GraphFile, Ids, build, check_pairs, first


def read_npz(path: Path) -> GraphFile:
    """Read a graph from a NumPy archive.

    It holds ``edges`` (m, 2), ``rotations`` (m, 3, 3) = R_i R_j^T and, if wanted, ``weights`` (m,) and ``n``.
    Cameras are 0 to n - 1; without ``n``, those that ``edges`` names. Nothing is unpickled.

    Raises
    ------
    InputError
        Naming the file and the array, and the row (from 0) where one is at fault.
    """
    arrays = _load(path, {"edges": "(m, 2)", "rotations": "(m, 3, 3)"}, optional=("weights", "n"))
    edges = _edges(path, arrays["edges"])
    m = len(edges)
    rotations = _checked(path, "rotations", arrays["rotations"], "iuf", (m, 3, 3)).astype(np.float64)
    weights = _weights(path, arrays["weights"], m) if "weights" in arrays else None
    cameras = _cameras(path, arrays["n"], edges) if "n" in arrays else None
    return build(edges, rotations, lambda row: f"{path}: row {row}", cameras=cameras, weights=weights)


def read_topology(path: Path) -> tuple[int, Ints]:
    """Read who is connected to whom from a NumPy archive with ``n`` and ``edges`` (m, 2), and nothing else of it.

    Returns
    -------
    tuple
        The number of cameras, and the edges (m, 2), i < j, in the order of the file. Nothing is unpickled.

    Raises
    ------
    InputError
        Naming the file and the array, and the row (from 0) where one is at fault.
    """
    arrays = _load(path, {"n": "()", "edges": "(m, 2)"})
    edges = _edges(path, arrays["edges"])
    cameras = _cameras(path, arrays["n"], edges)
    check_pairs(edges, lambda row: f"{path}: row {row}")
    return len(cameras), np.sort(edges, axis=1).astype(np.int32)


def _load(path: Path, required: Mapping[str, str], optional: tuple[str, ...] = ()) -> dict[str, NDArray[Any]]:
    """Arrays of an archive; `required` says which shape each that must be there has."""
    arrays = archive.load(path, (*required, *optional))
    for name, shape in required.items():
        if name not in arrays:
            raise InputError(f"{path}: there is no array '{name}' in it; it must hold one of shape {shape}")
    return arrays


def _checked(path: Path, name: str, array: NDArray[Any], kinds: str, shape: tuple[int, ...]) -> NDArray[Any]:
    """`array`, if of one of these dtype kinds and of this shape, where -1 is any length."""
    numbers = "numbers" if "f" in kinds else "whole numbers"
    if array.dtype.kind not in kinds:
        raise InputError(f"{path}: '{name}' holds {array.dtype}; it must hold {numbers}")
    if array.ndim != len(shape) or any(want not in (-1, has) for want, has in zip(shape, array.shape, strict=True)):
        raise InputError(f"{path}: '{name}' must have shape {str(shape).replace('-1', 'm')}, not {array.shape}")
    return array


def _edges(path: Path, array: NDArray[Any]) -> Ids:
    edges = _checked(path, "edges", array, "iu", (-1, 2)).astype(np.int64)
    if len(edges) == 0:
        raise InputError(f"{path}: 'edges' is empty")
    return edges


def _weights(path: Path, array: NDArray[Any], m: int) -> NDArray[np.float64]:
    weights = _checked(path, "weights", array, "iuf", (m,)).astype(np.float64)
    if (row := first(~(np.isfinite(weights) & (weights > 0)))) is not None:
        raise InputError(f"{path}: row {row}: the weight is {weights[row]:g}; weights must be positive numbers")
    return weights


def _cameras(path: Path, array: NDArray[Any], edges: Ids) -> Ids:
    n = int(_checked(path, "n", array, "iu", ()))
    if not 0 < n <= MOST_CAMERAS:
        raise InputError(f"{path}: 'n' is {n}, but must be from 1 to {MOST_CAMERAS}")
    if (row := first((edges >= n).any(axis=1))) is not None:
        raise InputError(f"{path}: row {row}: camera {edges[row].max()} is outside the graph; 'n' is {n}")
    return np.arange(n, dtype=np.int64)
