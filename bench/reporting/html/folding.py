"""Parts of a scene that are turned as one piece, in words: which cameras, by how much, in whose estimates, and why."""

import numpy as np

from bench.reporting.html import words
from bench.reporting.html.case import Case, Solved
from bench.reporting.html.section import Section, Table, Value, anchor
from bench.scoring.metrics.folds import (
    MIN_ANGLE_DEG,
    SMALLEST,
    Fold,
    Ids,
    SharedFold,
    border,
    shared_folds,
    smallest_fold,
)

LISTED = 200  # cameras
ALIKE_DEG = 2.0  # a range of angles that is told as one
TITLE = "Parts of the scene that are turned as one piece"
ALIGNMENT = (
    "Here errors depend on the alignment: l1 and anchors charge the turned cameras with the whole angle, least squares "
    "(chordal, karcher) spreads it over all cameras."
)


def fold_section(case: Case) -> list[Section]:
    """What is turned; empty where there is no truth to tell."""
    if not case.has_truth:
        return []
    name = anchor("folds", case.name)
    shared = shared_folds({solved.label: solved.folds for solved in case.solved})
    if not shared:
        return [Section(name, TITLE, (_nothing(_scored(case)),))]
    sentences = [sentence for part in shared for sentence in _sentences(case, part)]
    return [Section(name, TITLE, (*sentences, ALIGNMENT), None, (_table(case, shared),))]


def _scored(case: Case) -> int:
    return max(int(np.isfinite(solved.errors).sum()) for solved in case.solved)


def _nothing(scored: int) -> str:
    """What was looked for in vain, or why nothing was."""
    if scored < SMALLEST:
        return (
            f"Not looked for: {scored} cameras are scored, and of fewer than {SMALLEST} a part that is turned cannot "
            "be told from cameras that are wrong one by one."
        )
    return (
        f"None: in no estimate do {smallest_fold(scored)} or more of the {scored} scored cameras share one wrong "
        f"rotation of at least {MIN_ANGLE_DEG:g}°."
    )


def _sentences(case: Case, part: SharedFold[str]) -> list[str]:
    scored = _scored(case)
    size = len(part.cameras)
    what = f"{size} of {scored} cameras ({100 * size / scored:.0f} %) are turned as one piece {_angles(part)}"
    return [f"{_whose(case, part)}, {what}. {_cause(case, part)}", f"Cameras: {_ids(part.cameras)}."]


def _whose(case: Case, part: SharedFold[str]) -> str:
    count, methods = len(part.folds), len(case.solved)
    if methods == 1:
        return f"In the estimate of {case.solved[0].label}"
    if count == methods:
        return f"In the estimates of all {methods} methods"
    return (
        f"In the estimates of {count} of {methods} methods"
        if count > 1
        else f"Only in the estimate of {next(iter(part.folds))}"
    )


def _angles(part: SharedFold[str]) -> str:
    """``by 24.9°``, or several ranges of angles, each with the methods that have them, the largest first."""
    angles = sorted(((fold.angle_deg, label) for label, fold in part.folds.items()), reverse=True)
    ranges: list[list[tuple[float, str]]] = []
    for angle, label in angles:
        if ranges and ranges[-1][0][0] - angle <= ALIKE_DEG:
            ranges[-1].append((angle, label))
        else:
            ranges.append([(angle, label)])
    written = [(_range(own[-1][0], own[0][0]), words.enumeration([label for _, label in own])) for own in ranges]
    if len(written) == 1:
        return f"by {written[0][0]}"
    return "by " + "; by ".join(f"{angle} ({names})" for angle, names in written)


def _range(low: float, high: float) -> str:
    ends = f"{low:.1f}°", f"{high:.1f}°"
    return " to ".join(dict.fromkeys(ends))


def _cause(case: Case, part: SharedFold[str]) -> str:
    """Whether the measurements are turned too, by the best estimate that has the fold."""
    solved = next(s for s in case.solved if s.label in part.folds)
    agree, across = _border(case, solved, part.folds[solved.label])
    if across == 0:
        return "No edge joins them to the other cameras, so nothing is measured of how they lie to each other."
    share = f"{100 * agree / across:.0f} % agree better with the estimate of {solved.label} than with the truth"
    why = "the measurements are turned, or the truth is" if 2 * agree > across else "the measurements are not to blame"
    return f"Of the {across} edges that join them to the others, {share}: {why}."


def _border(case: Case, solved: Solved, fold: Fold) -> tuple[int, int]:
    return border(case.instance.problem, solved.residuals, case.at_truth, fold.cameras)


def _ids(cameras: Ids) -> str:
    ids = [str(camera) for camera in cameras[:LISTED]]
    more = len(cameras) - LISTED
    return ", ".join(ids) + (f" and {more} more" if more > 0 else "")


def _table(case: Case, shared: list[SharedFold[str]]) -> Table:
    rows: list[tuple[Value, ...]] = []
    for part in shared:
        for solved in case.solved:
            fold = part.folds.get(solved.label)
            if fold is not None:
                axis = ", ".join(f"{x:.2f}" for x in fold.axis)
                agree, across = _border(case, solved, fold)
                supported = round(100 * agree / across) if across else None
                spreads = (fold.spread_deg, fold.main_spread_deg)
                rows.append((solved.label, len(fold.cameras), fold.angle_deg, axis, *spreads, supported))
    head = (
        "Method",
        "Cameras",
        "Turned by °",
        "Axis in the world",
        "Spread °",
        "Spread of the rest °",
        "Edges for it %",
    )
    caption = (
        "Turned parts of each estimate. Spread: median distance of the cameras. Edges for it: of those to other "
        "cameras, how many agree better with the estimate than with the truth"
    )
    return Table(caption, head, tuple(rows))
