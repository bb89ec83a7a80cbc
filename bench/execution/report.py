"""Read back what a child reported; the code of the method ran in that process and could write anything."""

import json
from pathlib import Path
from typing import Any

from bench.execution import outcome
from bench.execution.outcome import Outcome

ESTIMATE_FILE = "estimate.npz"
RESULT_FILE = "result.json"

_MOST_BYTES = 2**28
_KINDS = {outcome.OK, outcome.OUT_OF_MEMORY, outcome.ERROR, outcome.INVALID_OUTPUT, outcome.SKIPPED}
_KEPT_BY_THE_PARENT = {"job", "outcome", "status", "finished", "limits", "versions", "provenance", "schema"}


def read_report(folder: Path) -> tuple[Outcome, dict[str, Any]] | None:
    """Outcome and scalars that a child left in its folder, or None where it left none.

    A report that no child of ours writes is the outcome ``crashed``.
    """
    path = folder / RESULT_FILE
    if not path.exists():
        return None
    try:
        return _checked(folder, _read(path))
    except Exception as error:  # whatever is wrong with the file is wrong with the child
        return Outcome(outcome.CRASHED, f"its report cannot be read: {type(error).__name__}"), {}


def _read(path: Path) -> Any:
    if not path.is_file() or path.stat().st_size > _MOST_BYTES:
        raise ValueError("not a report")
    return json.loads(path.read_text(encoding="utf-8"))


def _checked(folder: Path, report: Any) -> tuple[Outcome, dict[str, Any]]:
    if not isinstance(report, dict) or _KEPT_BY_THE_PARENT & report.keys():
        raise TypeError("not a report")
    kind, detail = report.pop("kind"), report.pop("detail")
    if kind not in _KINDS or not isinstance(detail, str):
        raise ValueError("not an outcome")
    if kind == outcome.OK and not (folder / ESTIMATE_FILE).is_file():
        raise FileNotFoundError("no estimate")
    for key, kinds in _TYPES.items():
        if key in report and (not isinstance(report[key], kinds) or isinstance(report[key], bool)):
            raise TypeError(key)
    if kind == outcome.OK and "solve_s" not in report:
        raise KeyError("solve_s")
    for key in ("notes", "warnings"):
        if not all(isinstance(text, str) for text in report.get(key, ())):
            raise TypeError(key)
    for checkpoint in report.get("checkpoints", ()):
        if not isinstance(checkpoint, dict) or checkpoint.keys() != {"iteration", "seconds", "diagnostics"}:
            raise TypeError("checkpoints")
    return Outcome(kind, detail), report


_NUMBER, _NOTHING = (int, float), type(None)
_TYPES: dict[str, tuple[type, ...]] = {
    "solve_s": _NUMBER,
    "conversion_s": _NUMBER,
    "peak_mib": _NUMBER,
    "waited": _NUMBER,
    "threads": (int,),
    "core": (int, _NOTHING),
    "iterations": (int, _NOTHING),
    "cost": (*_NUMBER, _NOTHING),
    "certificate": (*_NUMBER, _NOTHING),
    "stop_reason": (str,),
    "notes": (list,),
    "warnings": (list,),
    "checkpoints": (list,),
    "solves_s": (list,),
}
