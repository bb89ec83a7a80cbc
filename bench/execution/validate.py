"""Whether what a method returned can be stored and scored, whatever it is.

A plug-in may return anything. What passes here is plain arrays and plain numbers, so that nothing later has to ask.
"""

import itertools
import math
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import replace
from numbers import Integral, Real
from typing import Any

import numpy as np

from bench.core.errors import described
from bench.core.problem import ROTATION_TOLERANCE, Checkpoint, Estimate, Floats, Problem
from bench.core.words import counted
from bench.storage.record import Moment, Report

MOST_TEXT = 100_000  # characters of all notes, and of the stop reason
MOST_CHECKPOINTS = 100_000
MOST_WARNINGS = 50


def what_is_wrong(problem: Problem, estimate: Any, elapsed: float) -> str:
    """Say why the estimate cannot be scored, or nothing.

    Parameters
    ----------
    problem
        As it was before the method was given it.
    estimate
        What the method returned, in an `Estimate`.
    elapsed
        Seconds that `solve` took.
    """
    if type(estimate) is not Estimate:
        return f"solve must return an array or an Estimate, not {_name(estimate)}"
    return next(filter(None, _complaints(problem, estimate, elapsed)), "")


def reported(report: Report, estimate: Estimate) -> Report:
    """The report with what a valid estimate holds besides its arrays, in types that JSON has."""
    return replace(
        report,
        iterations=None if estimate.iterations is None else int(estimate.iterations),
        stop_reason=str(estimate.stop_reason),
        cost=None if estimate.cost is None else float(estimate.cost),
        certificate=None if estimate.certificate is None else float(estimate.certificate),
        notes=tuple(map(str, estimate.notes)),
        checkpoints=tuple(
            Moment(
                int(c.iteration),
                float(c.seconds),
                {str(name): float(value) for name, value in c.diagnostics.items()},
            )
            for c in estimate.checkpoints
        ),
    )


def kept_warnings(caught: Iterable[warnings.WarningMessage]) -> tuple[str, ...]:
    """Some of the different warnings of a solution, each on a line."""
    different = {described(w.message): None for w in itertools.islice(caught, 10_000) if isinstance(w.message, Warning)}
    return tuple(sorted(different)[:MOST_WARNINGS])


def _complaints(problem: Problem, estimate: Estimate, elapsed: float) -> Iterable[str]:
    yield _wrong_rotations("rotations", estimate.rotations, problem.n)
    if np.isnan(estimate.rotations).all(axis=(1, 2)).all():
        yield "no camera was solved"
    if estimate.edge_weights is not None:
        yield _wrong_weights(estimate.edge_weights, problem.m)
    if estimate.camera_sigma is not None:
        yield _wrong_sigma(estimate.camera_sigma, estimate.rotations)
    seconds = estimate.conversion_s
    if not _is_number(seconds):
        yield f"conversion_s must be a number of seconds, not {_brief(seconds)}"
    if not 0 <= seconds <= elapsed:
        yield f"conversion_s is {float(seconds):g} s, which is not within the time that solve took"
    if estimate.iterations is not None and not (_is_whole(estimate.iterations) and estimate.iterations >= 0):
        yield f"iterations must be a whole number or None, not {_brief(estimate.iterations)}"
    for name in ("cost", "certificate"):
        value = getattr(estimate, name)
        if value is not None and not (_is_number(value) and math.isfinite(value)):
            yield f"{name} must be a finite number or None, not {_brief(value)}"
    yield _wrong_texts(estimate)
    yield _wrong_checkpoints(estimate.checkpoints, problem.n)


def _wrong_rotations(what: str, rotations: Any, n: int) -> str:
    """Rotations must be a plain array (n, 3, 3) of rotations, where all NaN marks a camera that is not solved."""
    if (wrong := _wrong_array(what, rotations)) or rotations.shape != (n, 3, 3):
        return wrong or f"{what} must be an array of shape ({n}, 3, 3), not {rotations.shape}"
    if rotations.dtype.kind != "f":
        return f"{what} must be floating point, not {rotations.dtype}"
    solved = rotations[~np.isnan(rotations).all(axis=(1, 2))].astype(np.float64)
    finite = np.isfinite(solved).all(axis=(1, 2))
    if not finite.all():
        return f"{counted(int((~finite).sum()), 'camera has', 'cameras have')} entries that are not finite"
    small = (abs(solved) <= 2).all(axis=(1, 2))  # so that no square overflows
    solved = np.where(small[:, None, None], solved, 0.0)
    off = np.linalg.norm(solved @ solved.transpose(0, 2, 1) - np.eye(3), axis=(1, 2))
    bad = (off > ROTATION_TOLERANCE) | (np.linalg.det(solved) < 0)
    if bad.any():
        where = "" if what == "rotations" else f" of {what}"
        return f"{bad.sum()} of {len(solved)} matrices{where} are not rotations to {ROTATION_TOLERANCE:g}"
    return ""


def _wrong_weights(weights: Any, m: int) -> str:
    if (wrong := _wrong_array("edge_weights", weights)) or weights.shape != (m,):
        return wrong or f"edge_weights must have shape ({m},), not {weights.shape}"
    if weights.dtype.kind not in "fiub":
        return f"edge_weights must be numbers, not {weights.dtype}"
    bad = ~(np.isfinite(weights) & (weights >= 0))
    return f"{bad.sum()} of {m} edge_weights are negative or not finite" if bad.any() else ""


def _wrong_sigma(sigma: Any, rotations: Floats) -> str:
    n = len(rotations)
    if (wrong := _wrong_array("camera_sigma", sigma)) or sigma.shape != (n,):
        return wrong or f"camera_sigma must have shape ({n},), not {sigma.shape}"
    if sigma.dtype.kind not in "fiu":
        return f"camera_sigma must be numbers, not {sigma.dtype}"
    told = sigma[~np.isnan(rotations).all(axis=(1, 2))]
    bad = ~(np.isfinite(told) & (told >= 0))
    return f"{bad.sum()} of {n} camera_sigma are negative or not finite" if bad.any() else ""


def _wrong_array(what: str, array: Any) -> str:
    """Masked arrays, matrices, tensors and lists mean something else than the numbers they hold."""
    return "" if type(array) is np.ndarray else f"{what} must be a plain numpy array, not {_name(array)}"


def _wrong_texts(estimate: Estimate) -> str:
    notes, reason = estimate.notes, estimate.stop_reason
    if not _is_text(reason) or len(reason) > MOST_TEXT:
        return f"stop_reason must be text of at most {MOST_TEXT} characters, not {_brief(reason)}"
    if not isinstance(notes, tuple | list) or not all(map(_is_text, notes)):
        return f"notes must be a tuple of sentences, not {_brief(notes)}"
    if sum(map(len, notes)) > MOST_TEXT:
        return f"notes must have at most {MOST_TEXT} characters together"
    return ""


def _wrong_checkpoints(checkpoints: Any, n: int) -> str:
    if not isinstance(checkpoints, tuple | list) or not all(type(c) is Checkpoint for c in checkpoints):
        return f"checkpoints must be a tuple of Checkpoint, not {_brief(checkpoints)}"
    if len(checkpoints) > MOST_CHECKPOINTS:
        return f"there must be at most {MOST_CHECKPOINTS} checkpoints, not {len(checkpoints)}"
    return next(filter(None, (_wrong_checkpoint(k, c, n) for k, c in enumerate(checkpoints))), "")


def _wrong_checkpoint(k: int, checkpoint: Checkpoint, n: int) -> str:
    if not _is_whole(checkpoint.iteration) or not (_is_number(checkpoint.seconds) and checkpoint.seconds >= 0):
        return f"checkpoint {k} must have a whole number as iteration and seconds of at least 0"
    facts = checkpoint.diagnostics
    if not isinstance(facts, Mapping) or not all(isinstance(f, str) and _is_number(v) for f, v in facts.items()):
        return f"diagnostics of checkpoint {k} must be named numbers, not {_brief(facts)}"
    return _wrong_rotations(f"checkpoint {k}", checkpoint.rotations, n)


def _is_text(value: Any) -> bool:
    """Text that a file and a terminal can hold: no half of a surrogate pair."""
    return isinstance(value, str) and not any("\ud800" <= sign <= "\udfff" for sign in value)


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool) and abs(int(value)) < 2**63


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and (not _is_integral(value) or _is_whole(value))


def _is_integral(value: Any) -> bool:
    return isinstance(value, Integral)


def _name(value: Any) -> str:
    return type(value).__name__


def _brief(value: Any) -> str:
    """Type and, of a plain value, the value: a plug-in's own object may fail to be written."""
    if type(value) in (int, float, str, bool) and (type(value) is not int or _is_whole(value)):
        text = repr(value)
        return text if len(text) <= 80 else f"{text[:80]}..."
    return _name(value)
