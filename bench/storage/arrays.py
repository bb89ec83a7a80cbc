"""Problems and estimates as ``.npz`` files, float64 and unrounded, read without pickle."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core.errors import InputError, shown
from bench.core.problem import INFORMATION, Checkpoint, Estimate, Problem, WeightsKind
from bench.formats import archive
from bench.storage.record import Report


def save_problem(path: Path, problem: Problem) -> None:
    """Write a problem as uncompressed ``.npz``."""
    arrays: dict[str, Any] = {"n": problem.n, "edges": problem.edges, "rotations": problem.rotations}
    arrays |= {name: getattr(problem, name) for name in problem.carries}
    if problem.weights is not None:
        arrays["counted"] = problem.weights_kind == "count"
    with path.open("wb") as file:
        np.savez(file, **arrays)


def load_problem(path: Path) -> Problem:
    """Read what `save_problem` wrote; raises `InputError` where the file holds something else."""
    arrays = archive.load(path, ("n", "edges", "rotations", *INFORMATION, "counted"))
    try:
        n = arrays["n"]
        if n.shape != () or n.dtype.kind not in "iu":
            raise InputError(f"n must be a whole number, not {n.dtype} of shape {n.shape}")
        carried = {name: arrays[name] for name in INFORMATION if name in arrays}
        kind: WeightsKind = "count" if arrays.get("counted", False) else "precision"
        return Problem(int(n), arrays["edges"], arrays["rotations"], weights_kind=kind, **carried)
    except (KeyError, InputError) as error:
        raise InputError(f"{path}: {_said(error)}") from error


def save_estimate(path: Path, estimate: Estimate) -> None:
    """Write the arrays of an estimate, float64 and unrounded, as ``.npz``."""
    arrays: dict[str, Any] = {"rotations": np.asarray(estimate.rotations, dtype=np.float64)}
    for name in ("edge_weights", "camera_sigma"):
        if (values := getattr(estimate, name)) is not None:
            arrays[name] = np.asarray(values, dtype=np.float64)
    if estimate.checkpoints:
        arrays["checkpoints"] = np.stack([c.rotations for c in estimate.checkpoints])
    with path.open("wb") as file:
        np.savez(file, **arrays)


def load_estimate(path: Path, report: Report) -> Estimate:
    """Read what `save_estimate` wrote, with what the child told besides.

    Raises
    ------
    InputError
        Where the file holds something else, or another number of checkpoints than the report.
    """
    arrays = archive.load(path, ("rotations", "edge_weights", "camera_sigma", "checkpoints"))
    try:
        n = len(_floats(arrays["rotations"], (-1, 3, 3)))
        states = _floats(arrays["checkpoints"], (-1, n, 3, 3)) if "checkpoints" in arrays else ()
        return Estimate(
            rotations=arrays["rotations"],
            edge_weights=_floats(arrays["edge_weights"], (-1,)) if "edge_weights" in arrays else None,
            camera_sigma=_floats(arrays["camera_sigma"], (n,)) if "camera_sigma" in arrays else None,
            iterations=report.iterations,
            stop_reason=report.stop_reason,
            cost=report.cost,
            certificate=report.certificate,
            checkpoints=tuple(
                Checkpoint(moment.iteration, moment.seconds, state, moment.diagnostics)
                for state, moment in zip(states, report.checkpoints, strict=True)
            ),
            conversion_s=report.conversion_s or 0.0,
            notes=report.notes,
        )
    except (KeyError, ValueError) as error:
        raise InputError(f"{path}: {_said(error)}") from error


def _floats(array: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    if array.dtype != np.float64 or array.ndim != len(shape):
        raise ValueError(f"an array is {array.dtype} of shape {array.shape}")
    if any(want not in (-1, has) for want, has in zip(shape, array.shape, strict=True)):
        raise ValueError(f"an array has shape {array.shape}")
    return array


def _said(error: Exception) -> str:
    return f"there is no array {error}" if isinstance(error, KeyError) else shown(str(error), 200)
