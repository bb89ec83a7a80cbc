"""Open3D's pose graphs, as JSON."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from bench.core.errors import InputError
from bench.core.problem import Floats
from bench.formats.format import Beginning, Format
from bench.formats.graph import GraphFile, build, first
from bench.formats.information import marginal
from bench.formats.lines import decode, read_bytes

_ENDS = ("target_node_id", "source_node_id")
_LARGEST_ID = 2**31


def read_open3d(path: Path) -> GraphFile:
    """Read an Open3D PoseGraph.

    Matrices are stored column by column. The transformation of an edge takes points of its source into its target, so
    that its rotation is R_target R_source^T with R world to node; poses of nodes are initial guesses and not used.
    The information matrix (rotation, then translation) is the sum over points of the target of how their residuals
    change: its rotation lives in the frame of the target. What it says of the rotation alone is kept.

    Raises
    ------
    InputError
        Naming the file, and the edge (from 0) that cannot be used.
    """
    try:
        content = json.loads(decode(path, read_bytes(path)))
    except RecursionError:
        raise InputError(f"{path}: nested too deeply to be a pose graph") from None
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: not valid JSON: {str(error)[:200]}") from None
    nodes, edges = (_list(path, content, name) for name in ("nodes", "edges"))
    if not edges:
        raise InputError(f"{path}: the pose graph has no edges")

    def where(row: int) -> str:
        return f"{path}: edge {row}"

    ends = [[_id(edge, end, where(row)) for end in _ENDS] for row, edge in enumerate(edges)]
    ids = np.array(ends, dtype=np.int64)
    if (row := first((ids >= len(nodes)).any(axis=1))) is not None:
        raise InputError(f"{where(row)}: there is no node {ids[row].max()}; there are {len(nodes)}")
    poses = _matrices(edges, "transformation", 4, where)
    matrices = poses[:, :3, :3]
    precisions = None
    if all("information" in edge for edge in edges):
        precisions = marginal(_matrices(edges, "information", 6, where), slice(0, 3))
    return build(ids, matrices, where, cameras=np.arange(len(nodes)), precisions=precisions)


def _list(path: Path, content: Any, name: str) -> list[Any]:
    found = content.get(name) if isinstance(content, dict) else None
    if not isinstance(found, list):
        raise InputError(f"{path}: there is no list '{name}' in it; an Open3D PoseGraph has one")
    return found


def _id(edge: Any, name: str, where: str) -> int:
    value = edge.get(name) if isinstance(edge, dict) else None
    if not isinstance(value, int) or not 0 <= value < _LARGEST_ID:
        raise InputError(f"{where}: '{name}' must be the number of a node, from 0")
    return value


def _matrices(edges: list[dict[str, Any]], name: str, size: int, where: Any) -> Floats:
    """Square matrices (m, size, size), stored column by column."""
    columns = np.empty((len(edges), size * size))
    for row, edge in enumerate(edges):
        try:
            columns[row] = [float(number) for number in edge[name]]
        except (KeyError, TypeError, ValueError, OverflowError):
            raise InputError(f"{where(row)}: '{name}' must be {size * size} numbers") from None
    return columns.reshape(-1, size, size).transpose(0, 2, 1)


def _recognises(beginning: Beginning) -> bool:
    return beginning.data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{") and b'"PoseGraph' in beginning.data


FORMATS = (Format("open3d", "Open3D's PoseGraph as JSON", (".json",), _recognises, graph=read_open3d),)
