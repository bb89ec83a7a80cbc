"""What a child leaves, which may be anything: it is checked before it counts."""

import json
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.core import outcome, typed
from bench.core.errors import InputError
from bench.core.outcome import Outcome
from bench.storage.record import Report

ESTIMATE_FILE = "estimate.npz"
RESULT_FILE = "result.json"
BEGUN_FILE = "begun"  # empty; the method is compiled and loaded
LARGEST_RESULT = 2**24  # bytes; the scalars of a few hundred thousand checkpoints fit into it
OF_CHILDREN = (outcome.OK, outcome.SKIPPED, outcome.ERROR, outcome.OUT_OF_MEMORY, outcome.INVALID_OUTPUT)


@dataclass(frozen=True)
class Result:
    """How a child ended, as it says itself.

    Parameters
    ----------
    outcome, report
        What becomes part of the record.
    disk_full
        Why the estimate could not be written, where the disk was at fault.
    """

    outcome: Outcome
    report: Report
    disk_full: str = ""


class UnusableError(ValueError):
    """The child left something that is not a result; the message says what."""


def read_output(folder: Path) -> Result | None:
    """What the child has left in its folder; None where it left nothing.

    Raises
    ------
    UnusableError
        Where that is malformed, or the estimate that it promises is.
    """
    try:
        result = _result(folder / RESULT_FILE)
    except FileNotFoundError:
        return None
    if result.outcome.ok:
        _check_estimate(folder / ESTIMATE_FILE, len(result.report.checkpoints))
    return result


def _result(path: Path) -> Result:
    size = path.stat().st_size
    if size > LARGEST_RESULT:
        raise UnusableError(f"{path.name} has {size} bytes")
    try:
        content = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise UnusableError(f"{path.name} is not JSON ({error})") from error
    try:
        result = typed.read(Result, content, path.name)
    except InputError as error:
        raise UnusableError(str(error)) from error
    if result.outcome.kind not in OF_CHILDREN:
        raise UnusableError(f"{path.name}: '{result.outcome.kind}' is not for a child to tell")
    if result.outcome.ok and (result.report.solve_s is None or result.report.peak_mib is None):
        raise UnusableError(f"{path.name} does not tell what the solution took")
    return result


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
