"""What a file says of the accuracy of its measurements, as precisions of the rotation alone."""

import numpy as np

from bench.core.problem import Floats

_POSITIVE = 1e-6  # relative; as far below zero as rounding may take an eigenvalue
_LARGEST = 1e100  # products of larger ones may overflow


def symmetric(numbers: Floats, size: int) -> Floats:
    """Matrices (m, size, size) from their upper triangles (m, size (size + 1) / 2), row by row."""
    matrices = np.zeros((len(numbers), size, size))
    rows, columns = np.triu_indices(size)
    matrices[:, rows, columns] = numbers
    matrices[:, columns, rows] = numbers
    return matrices


def marginal(information: Floats, rotation: slice) -> Floats:
    """Precisions (m, k, k) of the rotation where nothing is known of the translation.

    Of an information matrix [[A, B], [B^T, C]] of rotation and translation this is A - B C^-1 B^T, the inverse of the
    block of the covariance; it is A where B or C are not finite numbers, as some programs write them.

    Parameters
    ----------
    information
        (m, d, d), symmetric.
    rotation
        Which rows are the rotation's.
    """
    size = information.shape[1]
    turn = np.arange(size)[rotation]
    rest = np.setdiff1d(np.arange(size), turn)
    own = information[:, turn[:, None], turn]
    mixed, others = information[:, turn[:, None], rest], information[:, rest[:, None], rest]
    known = (abs(information) < _LARGEST).all(axis=(1, 2))
    result = own.copy()
    with np.errstate(all="ignore"):  # what is not finite is found where precisions are checked
        result[known] -= mixed[known] @ np.linalg.pinv(others[known], hermitian=True) @ mixed[known].transpose(0, 2, 1)
    return result


def usable(precisions: Floats) -> tuple[Floats | None, tuple[str, ...]]:
    """Precisions (m, 3, 3), exactly symmetric and positive; or None, and a note that says why.

    There is no note where all are one multiple of the identity: that says nothing of one measurement or another.
    """
    m = len(precisions)
    size = abs(precisions).max(axis=(1, 2))
    sane = (size > 0) & (size < _LARGEST)  # not NaN
    values, vectors = np.linalg.eigh(np.where(sane[:, None, None], precisions, np.eye(3)))
    wrong = ~sane | (values[:, 0] < -_POSITIVE * size)
    with np.errstate(invalid="ignore"):  # infinity less infinity
        wrong |= (abs(precisions - precisions.transpose(0, 2, 1)).max(axis=(1, 2)) > _POSITIVE * size) & sane
    if wrong.any():
        return None, (
            f"the information of {wrong.sum()} of {m} edges is no symmetric positive matrix: information is not used",
        )
    if values.max() - values.min() <= _POSITIVE * values.max():
        return None, ()
    return (vectors * np.maximum(values, 0)[:, None]) @ vectors.transpose(0, 2, 1), ()
