"""Read what a child leaves, which may be anything: it is checked before it counts."""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from bench.core import outcome
from bench.core.outcome import Outcome

ESTIMATE_FILE = "estimate.npz"
RESULT_FILE = "result.json"
DISK_FULL = "disk_full"  # in a result: why the estimate could not be written
LARGEST_RESULT = 2**24  # bytes; the scalars of a few hundred thousand checkpoints fit into it
OF_CHILDREN = (outcome.OK, outcome.SKIPPED, outcome.ERROR, outcome.OUT_OF_MEMORY, outcome.INVALID_OUTPUT)


OF_THE_HARNESS = {"job", "outcome", "status", "finished", "limits", "versions", "provenance", "schema"}
REQUIRED = {"solve_s", "peak_mib", "checkpoints"}
_NUMBER, _NOTHING = (int, float), type(None)
TYPES: dict[str, tuple[type, ...]] = {
    **dict.fromkeys(("solve_s", "conversion_s", "peak_mib", "waited"), _NUMBER),
    **dict.fromkeys(("cost", "certificate"), (*_NUMBER, _NOTHING)),
    **dict.fromkeys(("core", "iterations"), (int, _NOTHING)),
    **dict.fromkeys(("notes", "warnings", "checkpoints", "solves_s"), (list,)),
    "threads": (int,),
    "stop_reason": (str,),
}


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
    if forged := OF_THE_HARNESS & report.keys():
        raise UnusableError(f"{path.name} tells '{min(forged)}', which is not for a child to tell")
    missing = REQUIRED - report.keys() if ended.kind == outcome.OK else ()
    if missing:
        raise UnusableError(f"{path.name} does not tell {' and '.join(sorted(missing))}")
    for name in report.keys() & TYPES.keys():
        if not isinstance(report[name], TYPES[name]) or isinstance(report[name], bool):
            raise UnusableError(f"{path.name}: '{name}' is a {type(report[name]).__name__}")
    _check_lists(path, report)
    return ended, report


def _check_lists(path: Path, report: dict[str, Any]) -> None:
    if not all(isinstance(text, str) for name in ("notes", "warnings") for text in report.get(name, ())):
        raise UnusableError(f"{path.name}: notes and warnings are sentences")
    for checkpoint in report.get("checkpoints", ()):
        if not isinstance(checkpoint, dict) or checkpoint.keys() != {"iteration", "seconds", "diagnostics"}:
            raise UnusableError(f"{path.name}: a checkpoint is not one")


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
