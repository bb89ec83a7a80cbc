"""Read what a child leaves, which may be anything: it is checked before it counts."""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from bench.execution import outcome
from bench.execution.child import ESTIMATE_FILE, RESULT_FILE
from bench.execution.outcome import Outcome

LARGEST_RESULT = 2**24  # bytes; the scalars of a few hundred thousand checkpoints fit into it
OF_CHILDREN = (outcome.OK, outcome.SKIPPED, outcome.ERROR, outcome.OUT_OF_MEMORY, outcome.INVALID_OUTPUT)


class UnusableError(ValueError):
    """The child left something that is not a result; the message says what."""


def read_output(folder: Path) -> tuple[Outcome, dict[str, Any]] | None:
    """Outcome and scalars that the child has left in its folder; None where it left none.

    Raises
    ------
    UnusableError
        Where they are malformed, or the estimate that they promise is.
    """
    try:
        ended, report = _result(folder / RESULT_FILE)
    except FileNotFoundError:
        return None
    if ended.kind == outcome.OK:
        _check_estimate(folder / ESTIMATE_FILE, len(report["checkpoints"]))
    return ended, report


def _result(path: Path) -> tuple[Outcome, dict[str, Any]]:
    size = path.stat().st_size
    if size > LARGEST_RESULT:
        raise UnusableError(f"{path.name} has {size} bytes")
    try:
        report = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise UnusableError(f"{path.name} is not JSON ({error})") from error
    if not isinstance(report, dict) or report.get("kind") not in OF_CHILDREN:
        raise UnusableError(f"{path.name} tells no outcome")
    if not isinstance(detail := report.pop("detail", None), str):
        raise UnusableError(f"{path.name} tells no reason of its outcome")
    ended = Outcome(report.pop("kind"), detail)
    if ended.kind == outcome.OK:
        if not isinstance(report.get("solve_s"), float) or not isinstance(report.get("peak_mib"), float):
            raise UnusableError(f"{path.name} tells no time or memory")
        if not isinstance(report.get("checkpoints"), list):
            raise UnusableError(f"{path.name} tells no checkpoints")
    return ended, report


def _check_estimate(path: Path, checkpoints: int) -> None:
    """Read every byte of an estimate, a piece at a time, and the shapes of its arrays."""
    try:
        with zipfile.ZipFile(path) as archive:
            if any(member.compress_type != zipfile.ZIP_STORED for member in archive.infolist()):
                raise UnusableError(f"{path.name} is compressed")
            if (broken := archive.testzip()) is not None:
                raise UnusableError(f"{path.name}: {broken} is broken")
            shapes = {member.filename: _shape(archive, member) for member in archive.infolist()}
    except (OSError, ValueError, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise UnusableError(f"{path.name} cannot be read: {error}") from error
    rotations = shapes.get("rotations.npy", ())
    if rotations[1:] != (3, 3):
        raise UnusableError(f"{path.name} holds no rotations")
    if shapes.get("checkpoints.npy", (0, *rotations)) != (checkpoints, *rotations):
        raise UnusableError(f"{path.name} does not hold the checkpoints that {RESULT_FILE} tells of")


def _shape(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> tuple[int, ...]:
    """Shape of a member that holds an array of floats, and exactly that."""
    with archive.open(member) as file:
        version = np.lib.format.read_magic(file)
        if version != (1, 0):
            raise ValueError(f"version {version} of the format of {member.filename}")
        shape, _, dtype = np.lib.format.read_array_header_1_0(file)
        if dtype != np.float64 or file.tell() + 8 * int(np.prod(shape, dtype=object)) != member.file_size:
            raise ValueError(f"{member.filename} is not an array of float64")
    return shape
