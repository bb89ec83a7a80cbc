"""MATLAB files with ``RR`` and ``I``, as codes of rotation averaging keep them."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core.errors import InputError, described
from bench.formats.format import Beginning, Format
from bench.formats.graph import GraphFile, build
from bench.formats.lines import read_bytes

_MAGIC = b"MATLAB 5.0 MAT-file"
_V73 = b"MATLAB 7.3 MAT-file"


def read_matlab(path: Path) -> GraphFile:
    """Read relative rotations ``RR`` (3, 3, m) of pairs of cameras ``I`` (2, m), numbered from 1.

    By the convention of Chatterjee and Govindu's code (L1-IRLS, 2013), which others follow, RR(:,:,k) of
    I(:,k) = [i; j] satisfies R_j = RR R_i: it is R_j R_i^T, the transpose of ours.

    Raises
    ------
    InputError
        Naming the file and the array, and the pair (from 1) where one is at fault.
    """
    from scipy.io import loadmat

    data = read_bytes(path)
    if data.startswith(_V73):
        raise InputError(f"{path}: this is a MATLAB 7.3 file; write it with save(..., '-v7')")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            content = loadmat(path, variable_names=["RR", "I"])
    except Exception as error:  # a damaged file may fail in any of a dozen ways
        raise InputError(f"{path}: cannot be read as a MATLAB file: {described(error)}") from error
    pairs, matrices = _numbers(path, content, "I"), _numbers(path, content, "RR")
    if matrices.ndim == 2:
        matrices = matrices[:, :, None]  # MATLAB drops the last axis of a single matrix
    m = matrices.shape[-1]
    if matrices.shape != (3, 3, m) or pairs.shape != (2, m) or m == 0:
        raise InputError(f"{path}: RR must be 3 x 3 x m and I 2 x m, not {matrices.shape} and {pairs.shape}")
    whole = np.nan_to_num(pairs, nan=0.0)
    if not ((pairs == np.round(whole)) & (whole >= 1) & (whole < 2**31)).all():
        raise InputError(f"{path}: 'I' must hold the numbers of cameras, from 1")
    return build(pairs.T.astype(np.int64), matrices.transpose(2, 1, 0), lambda row: f"{path}: column {row + 1} of I")


def _numbers(path: Path, content: dict[str, Any], name: str) -> NDArray[np.float64]:
    array = content.get(name)
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "iuf":
        raise InputError(f"{path}: there is no array of numbers '{name}' in it; RR is 3 x 3 x m and I 2 x m")
    return array.astype(np.float64)


def _recognises(beginning: Beginning) -> bool:
    return beginning.data.startswith((_MAGIC, _V73))


FORMATS = (Format("matlab", "MATLAB file with RR (3, 3, m) and I (2, m)", (".mat",), _recognises, graph=read_matlab),)
