"""The weights of a trained method: plain arrays, with where they come from and the hash that says which they are."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core.errors import InputError
from bench.formats import archive

PROVENANCE = "provenance"
_REMEDY = "write it with `train`, or leave the parameter out for the weights that are shipped"

Arrays = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Weights:
    """What training found.

    Parameters
    ----------
    arrays
        By name; float32.
    provenance
        Command, seed, data, cost and validation of the training, as JSON can hold it.
    """

    arrays: Arrays
    provenance: Mapping[str, Any]

    @property
    def sha256(self) -> str:
        """Hash of the arrays, with their names and shapes."""
        return hash_of(self.arrays)

    @property
    def parameters(self) -> int:
        """Number of trained parameters."""
        return sum(array.size for array in self.arrays.values())


def hash_of(arrays: Arrays) -> str:
    """Hash of arrays with their names and shapes, whatever the order."""
    total = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name], dtype="<f4")
        total.update(f"{name}{array.shape}".encode())
        total.update(array.tobytes())
    return total.hexdigest()


def read_weights(path: Path) -> Weights:
    """Read a file that `write_weights` wrote; pickles are never loaded.

    Raises
    ------
    InputError
        Where it is no such file, or its arrays are not those its provenance has the hash of.
    """
    return _read(path, path.stat().st_mtime_ns if path.is_file() else 0)


@lru_cache(maxsize=16)
def _read(path: Path, _modified: int) -> Weights:
    names = archive.names(path)
    found = archive.load(path, names, texts=(PROVENANCE,))
    try:
        provenance = json.loads(str(found.pop(PROVENANCE)))
        expected = str(provenance["sha256"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: has no provenance, so it holds no trained weights; {_REMEDY}") from error
    arrays = {name: np.asarray(array, dtype=np.float32) for name, array in found.items()}
    for array in arrays.values():
        array.setflags(write=False)
    if hash_of(arrays) != expected:
        raise InputError(f"{path}: its arrays are not those that were trained; {_REMEDY}")
    return Weights(arrays, provenance)


def write_weights(path: Path, arrays: Arrays, provenance: Mapping[str, Any]) -> None:
    """Write arrays with their provenance and hash; a file of that name is replaced at once, never half."""
    text = json.dumps({**provenance, "sha256": hash_of(arrays)}, indent=1)
    members = {name: np.asarray(array, np.float32) for name, array in arrays.items()}
    archive.write(path, {**members, PROVENANCE: np.array(text)})
