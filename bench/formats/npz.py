"""Graphs and absolute rotations as NumPy archives."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core.errors import InputError, shown
from bench.core.problem import MOST_CAMERAS, Floats, Ints, WeightsKind
from bench.formats import archive
from bench.formats.format import Format, RotationsFile, Solution
from bench.formats.graph import GraphFile, Ids, build, check_ends, checked_rotations, first

_KINDS: dict[str, WeightsKind] = {"count": "count", "precision": "precision"}
_PRECISIONS = ("precisions", "hessians", "covariances")


def read_npz(path: Path) -> GraphFile:
    """Read a graph from a NumPy archive.

    It holds ``edges`` (m, 2), ``rotations`` (m, 3, 3) = R_i R_j^T and, if wanted, ``n``; without, cameras are those
    that ``edges`` names. What says how far each measurement is to be trusted: ``weights`` (m,) or ``num_matches`` (m,)
    are counts, unless ``weights_kind`` is the text "precision"; ``precisions`` (m, 3, 3) or ``hessians`` (up to one
    scale) or, inverse, ``covariances`` are those of d in R_ij = exp(d) R_i R_j^T, in frame i. ``gravity`` (n, 3) in the
    axes of each camera is NaN where unknown, ``names`` (n,) is text. Nothing is unpickled.

    Raises
    ------
    InputError
        Naming the file and the array, and the row (from 0) where one is at fault.
    """
    required = {"edges": "(m, 2)", "rotations": "(m, 3, 3)"}
    optional = ("n", "weights", "num_matches", *_PRECISIONS, "gravity")
    arrays = _load(path, required, optional, ("weights_kind", "names"))
    edges = _edges(path, arrays["edges"])
    m = len(edges)
    cameras = _cameras(path, arrays["n"], edges) if "n" in arrays else np.unique(edges)
    weights = next((arrays[name] for name in ("weights", "num_matches") if name in arrays), None)
    names = _texts(path, "names", arrays["names"]) if "names" in arrays else None
    if names is not None and len(names) != len(cameras):
        raise InputError(f"{path}: 'names' has {len(names)} entries, but there are {len(cameras)} cameras")
    gravity = _floats(path, "gravity", arrays["gravity"], (len(cameras), 3)) if "gravity" in arrays else None
    if gravity is not None and (row := first(~_is_direction(gravity))) is not None:
        raise InputError(f"{path}: row {row}: 'gravity' is {gravity[row].tolist()}, neither a direction nor NaN")
    return build(
        edges,
        _floats(path, "rotations", arrays["rotations"], (m, 3, 3)),
        lambda row: f"{path}: row {row}",
        cameras=cameras,
        weights=None if weights is None else _weights(path, weights, m),
        weights_kind=_kind(path, arrays["weights_kind"]) if "weights_kind" in arrays else "count",
        precisions=_precisions(path, arrays, m),
        gravity=gravity,
        names=names,
    )


def read_npz_rotations(path: Path) -> RotationsFile:
    """Read absolute rotations (n, 3, 3), world to camera: the array ``truth``, or ``rotations`` with its ``cameras``.

    Raises
    ------
    InputError
        Naming the file and the array, and the row (from 0) where one is at fault.
    """
    arrays = archive.load(path, ("truth", "rotations", "cameras", "names"), texts=("names",))
    name = "truth" if "truth" in arrays else "rotations"
    if name not in arrays:
        raise InputError(f"{path}: there is neither an array 'truth' nor 'rotations' (n, 3, 3) in it")
    rotations = _floats(path, name, arrays[name], (-1, 3, 3))
    n = len(rotations)
    cameras = _checked(path, "cameras", arrays.get("cameras", np.arange(n)), "iu", (n,)).astype(np.int64)
    if len(np.unique(cameras)) < n:
        raise InputError(f"{path}: 'cameras' names a camera twice")
    names = _texts(path, "names", arrays["names"]) if "names" in arrays else None
    if names is not None and len(names) != n:
        raise InputError(f"{path}: 'names' has {len(names)} entries, but there are {n} cameras")
    return RotationsFile(cameras, known_rotations(rotations, lambda row: f"{path}: row {row}"), names)


def known_rotations(rotations: Floats, where: Any) -> Floats:
    """Rotations (n, 3, 3), checked where they are not NaN throughout."""
    known = np.flatnonzero(~np.isnan(rotations).all(axis=(1, 2)))
    out = np.full_like(rotations, np.nan)
    out[known] = checked_rotations(rotations[known], lambda row: where(int(known[row])))
    return out


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
    check_ends(edges, lambda row: f"{path}: row {row}")
    low, high = np.minimum(*edges.T), np.maximum(*edges.T)
    keys = low * len(cameras) + high
    if not np.diff(np.sort(keys)).all():  # several times quicker than to ask where as well
        _, kept = np.unique(keys, return_index=True)
        row = int(np.setdiff1d(np.arange(len(keys)), kept)[0])
        raise InputError(
            f"{path}: row {row}: the edge between cameras {edges[row, 0]} and {edges[row, 1]} is there already"
        )
    return len(cameras), np.stack([low, high], axis=1).astype(np.int32)


def _load(
    path: Path, required: Mapping[str, str], optional: tuple[str, ...] = (), texts: tuple[str, ...] = ()
) -> dict[str, NDArray[Any]]:
    """Arrays of an archive; `required` says which shape each that must be there has."""
    arrays = archive.load(path, (*required, *optional, *texts), texts)
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


def _floats(path: Path, name: str, array: NDArray[Any], shape: tuple[int, ...]) -> Floats:
    return _checked(path, name, array, "iuf", shape).astype(np.float64)


def _texts(path: Path, name: str, array: NDArray[Any]) -> tuple[str, ...]:
    try:
        return tuple(str(text) for text in array.ravel().tolist())
    except (ValueError, SystemError):  # code points that no text has
        raise InputError(f"{path}: '{name}' does not hold text") from None


def _kind(path: Path, array: NDArray[Any]) -> WeightsKind:
    words = _texts(path, "weights_kind", array)
    if len(words) != 1 or words[0] not in _KINDS:
        raise InputError(f"{path}: 'weights_kind' is {shown(words)}; it must be 'count' or 'precision'")
    return _KINDS[words[0]]


def _precisions(path: Path, arrays: Mapping[str, NDArray[Any]], m: int) -> Floats | None:
    given = [name for name in _PRECISIONS if name in arrays]
    if not given:
        return None
    matrices = _floats(path, given[0], arrays[given[0]], (m, 3, 3))
    if given[0] != "covariances":
        return matrices
    sane = np.isfinite(matrices).all(axis=(1, 2))
    with np.errstate(all="ignore"):  # what is not positive is found where precisions are checked
        matrices[sane] = np.linalg.pinv(matrices[sane], hermitian=True)
    return matrices


def _is_direction(gravity: Floats) -> NDArray[np.bool_]:
    small = np.where(abs(gravity) < 1e100, gravity, 0.0)  # squares that do not overflow
    return (np.linalg.norm(small, axis=1) > 0) & (small == gravity).all(axis=1) | np.isnan(gravity).all(axis=1)


def _edges(path: Path, array: NDArray[Any]) -> Ids:
    edges = _checked(path, "edges", array, "iu", (-1, 2)).astype(np.int64)
    if len(edges) == 0:
        raise InputError(f"{path}: 'edges' is empty")
    return edges


def _weights(path: Path, array: NDArray[Any], m: int) -> Floats:
    weights = _floats(path, "weights", array, (m,))
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


def _write(path: Path, solution: Solution, graph: GraphFile | None) -> None:
    arrays: dict[str, Any] = {"cameras": solution.cameras, "rotations": solution.rotations, **solution.extras}
    if graph is not None and graph.names is not None:
        arrays["names"] = np.array(solution.names)
    with path.open("wb") as file:  # given a name, savez would put .npz behind it
        np.savez(file, **arrays)


def _contents(path: Path) -> frozenset[str]:
    named = archive.names(path)
    has = {"graph": {"edges", "rotations"} <= named, "rotations": "truth" in named or "edges" not in named}
    return frozenset(name for name, held in has.items() if held)


FORMATS = (
    Format(
        "npz",
        "NumPy archive: edges, rotations, weights, precisions, gravity, names; or cameras and rotations",
        (".npz",),
        lambda beginning: beginning.data.startswith(b"PK"),
        graph=read_npz,
        rotations=read_npz_rotations,
        write=_write,
        contents=_contents,
    ),
)
