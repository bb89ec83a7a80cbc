"""What is wrong with the conventions of truth and measurements, in numbers and in a sentence. Nothing is converted."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.core.problem import Floats, Problem
from bench.scoring.conventions.against_truth import Explained, explain, null_residuals
from bench.scoring.conventions.closure import Closing, closing
from bench.scoring.conventions.contrast import APART, LADDER_DEG, Contrast, logs
from bench.scoring.conventions.readings import Change, Ids

AGREES_DEG = 5.0  # median closure, up to which measurements are said to agree with each other
TELLS = 0.3  # by so much in the log must residuals be smaller than those at the truth of other cameras
SOLID = 0.5  # share of right edges, judged by closed loops, from which on a truth must fit some of them
NAMED = 3  # other explanations
SOME = "R_ij^T in place of R_ij on some edges"


@dataclass(frozen=True)
class Diagnosis:
    """A convention that is clearly wrong as given, and the one that explains the data.

    Parameters
    ----------
    best
        What is written in place of what was read; empty where none of the known mistakes explains the data.
    as_given_deg, best_deg
        Median residual of the edges at the truth, or of loops where there is no truth; as given and as explained.
    tolerance_deg, share_as_given, share
        Share of these residuals within a tolerance; as given and as explained.
    loops_deg
        Median closure of triangles, or of longer loops where there are none, as given; NaN without loops.
    alternatives
        Other explanations that fit these data as well.
    sentence
        All of this in words, without a full stop.
    """

    best: str
    as_given_deg: float
    best_deg: float
    tolerance_deg: float
    share_as_given: float
    share: float
    loops_deg: float
    alternatives: tuple[str, ...]
    sentence: str


def diagnose(
    problem: Problem,
    truth: Floats | None = None,
    *,
    ids: Ids | None = None,
    names: Sequence[str] | None = None,
    table: Floats | None = None,
) -> Diagnosis | None:
    """Try the known mistakes on the truth against the measurements, or on the measurements alone.

    Transposed measurements, truth from camera to world, other axes of the cameras, quaternions with the scalar at the
    wrong end, ids shifted, reversed or sorted as text, edges of both directions mixed; alone and together. Something is
    said only where the data as given are clearly wrong: another reading fits much better, by what chance cannot do, or
    measurements that agree with each other fit the truth nowhere.

    Parameters
    ----------
    truth
        (n, 3, 3), NaN where unknown; None to look at the measurements alone.
    ids
        (n,) what the file calls the cameras, ascending; by default 0 to n - 1.
    names
        (n,) of the cameras, where they have some.
    table
        (N, 3, 3) the truth of all ids 0 to N - 1 of the file, also of those that are not in the graph.
    """
    if truth is None or not np.isfinite(truth).all(axis=(1, 2)).any():
        return _of_loops(closing(problem))
    ids = np.arange(problem.n) if ids is None else np.asarray(ids, dtype=np.int64)
    explained = explain(problem, truth, ids, names, table)
    if explained.contrast or explained.reversed:
        return _of_truth(explained, closing(problem))
    if len(explained.given) < 2 or _tells(problem, truth, explained.given):
        return None
    loops = closing(problem)
    return _of_loops(loops) or _contradiction(explained.given, loops)


def _tells(problem: Problem, truth: Floats, given: Floats) -> bool:
    """Whether the truth as given is better than that of other cameras."""
    return bool(np.median(logs(given)) < np.median(logs(null_residuals(problem, truth))) - TELLS)


def _of_truth(explained: Explained, loops: Closing | None) -> Diagnosis:
    given, own = explained.given, explained.residuals
    as_given, best, closed = float(np.median(given)), float(np.median(own)), _median(loops)
    at = explained.contrast or Contrast.at(LADDER_DEG[-1], given, own)
    said = f"contradict the truth (median {as_given:.1f} degrees)"
    if loops is not None and closed <= AGREES_DEG:
        said = f"agree with each other ({loops.kind} close to {closed:.2f} degrees) and {said}"
    said = f"the measurements {said}"
    others = tuple(_name(other.changes) for other in explained.alike)
    if explained.contrast:
        fits = f"the truth fits to {best:.2f} degrees"
        if best > at.tolerance_deg:
            fits = f"{100 * at.best:.0f} % of the edges fit to {at.tolerance_deg:g} degrees, not {100 * at.given:.0f} %"
        said += f"; with {_name(explained.changes)} {fits}: it seems that {_why(explained.changes)}"
        if others:
            named = "; ".join(others[:NAMED]) + (f"; {len(others) - NAMED} more" if len(others) > NAMED else "")
            said += f" (as good here: {named})"
    if explained.reversed:
        mixed = (
            f"{100 * explained.reversed:.0f} % of the edges that fit the truth do so only transposed (to {best:.2f} "
            "degrees, median of all): it seems that both directions are mixed"
        )
        said = f"{said}; {mixed}" if explained.contrast else mixed
    name = ", then ".join(filter(None, (_name(explained.changes), SOME if explained.reversed else "")))
    return Diagnosis(name, as_given, best, at.tolerance_deg, at.given, at.best, closed, others, said)


def _of_loops(loops: Closing | None) -> Diagnosis | None:
    if loops is None or not (loops.changes or loops.reversed):
        return None
    as_given, best, at = _median(loops), float(np.median(loops.best)), loops.contrast
    shares = f"{100 * at.best:.0f} % of the {loops.kind} close to {at.tolerance_deg:g} degrees"
    if loops.changes:
        name, why = _name(loops.changes), _why(loops.changes)
        said = (
            f"with {name} {shares} (median {best:.2f}), and {100 * at.given:.0f} % as they are (median {as_given:.2f})"
        )
    else:
        name, why = SOME, "both directions are mixed"
        said = (
            f"with {100 * loops.reversed:.0f} % of the edges transposed {shares} (median {best:.2f}), and "
            f"{100 * at.given:.0f} % as they are (median {as_given:.2f})"
        )
    said = f"{said}: it seems that {why}"
    return Diagnosis(name, as_given, best, at.tolerance_deg, at.given, at.best, as_given, (), said)


def _contradiction(given: Floats, loops: Closing | None) -> Diagnosis | None:
    """Measurements that agree with each other, and a truth that fits none of them under any reading."""
    if loops is None or loops.kind != "triangles":
        return None
    as_given, closed, unknown = float(np.median(given)), _median(loops), float("nan")
    for tolerance in LADDER_DEG:
        closing_share, by_chance = (float((values <= tolerance).mean()) for values in (loops.given, loops.null))
        right = closing_share ** (1 / 3)  # three right edges close a triangle
        fitting = float((given <= APART * tolerance).mean())
        if right >= SOLID and closing_share > APART * by_chance and APART**2 * fitting <= right:
            said = (
                f"the measurements agree with each other (triangles: {100 * closing_share:.0f} % close to "
                f"{tolerance:g} degrees, median {closed:.2f}) and contradict the truth (median {as_given:.1f}); none "
                "of the known mistakes explains it: is it the truth of these cameras, in this order?"
            )
            return Diagnosis("", as_given, unknown, tolerance, fitting, unknown, closed, (), said)
    return None


def _median(loops: Closing | None) -> float:
    return float(np.median(loops.given)) if loops else float("nan")


def _name(changes: Sequence[Change]) -> str:
    return ", then ".join(change.name for change in changes)


def _why(changes: Sequence[Change]) -> str:
    return " and that ".join(change.why for change in changes)
