"""Problems and estimates as ``.npz`` files, float64 and unrounded, read without pickle."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from bench.problem import Checkpoint, Estimate, Problem


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """The arrays in an ``.npz``; numpy alone leaves the file open where it is damaged."""
    with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
        yield data


def save_problem(path: Path, problem: Problem) -> None:
    """Write a problem as uncompressed ``.npz``."""
    arrays: dict[str, Any] = {"n": problem.n, "edges": problem.edges, "rotations": problem.rotations}
    if problem.weights is not None:
        arrays["weights"] = problem.weights
    with path.open("wb") as file:
        np.savez(file, **arrays)


def load_problem(path: Path) -> Problem:
    """Read what `save_problem` wrote."""
    with opened(path) as data:
        weights = data.get("weights", None)
        return Problem(int(data["n"]), data["edges"], data["rotations"], weights)


def save_estimate(path: Path, estimate: Estimate) -> None:
    """Write the arrays of an estimate, float64 and unrounded, as ``.npz``."""
    arrays: dict[str, Any] = {"rotations": np.asarray(estimate.rotations, dtype=np.float64)}
    if estimate.edge_weights is not None:
        arrays["edge_weights"] = np.asarray(estimate.edge_weights, dtype=np.float64)
    if estimate.checkpoints:
        arrays["checkpoints"] = np.stack([c.rotations for c in estimate.checkpoints])
    with path.open("wb") as file:
        np.savez(file, **arrays)


def load_estimate(path: Path, scalars: dict[str, Any]) -> Estimate:
    """Read what `save_estimate` wrote, with the scalars that the record holds."""
    with opened(path) as data:
        states = data.get("checkpoints", ())
        return Estimate(
            rotations=data["rotations"],
            edge_weights=data.get("edge_weights", None),
            iterations=scalars.get("iterations"),
            stop_reason=scalars.get("stop_reason", ""),
            cost=scalars.get("cost"),
            certificate=scalars.get("certificate"),
            checkpoints=tuple(
                Checkpoint(rotations=state, **facts)
                for state, facts in zip(states, scalars.get("checkpoints", ()), strict=True)
            ),
            conversion_s=scalars.get("conversion_s", 0.0),
            notes=tuple(scalars.get("notes", ())),
        )
