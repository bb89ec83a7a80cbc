"""What the measurements say of a scene: cycles, edge weights against known outliers, costs against the truth's."""

import math
from collections.abc import Sequence

import numpy as np

from bench.core.problem import Floats
from bench.reporting.figures.looks import Looks
from bench.reporting.figures.paint_plotly import FigureDict, dash
from bench.reporting.html import words
from bench.reporting.html.case import Case, Solved
from bench.reporting.html.section import Section, Table, Value, anchor
from bench.reporting.tables.printed import area, degrees
from bench.scoring.metrics.cycles import WRONG_DEG, agreeing_share, sample_cycles
from bench.scoring.metrics.roc import roc_curve

BINS = np.geomspace(0.1, 180, 41)  # degrees
NEXT_TO_NONE = 0.05
CLOSED_DEG = 5.0
SAME_COST = 0.001  # relative


def cycle_section(case: Case) -> list[Section]:
    """How well triangles close, and whether wrong edges agree with each other; empty where there is no triangle."""
    cycles = sample_cycles(case.instance.problem)
    if not len(cycles.residuals):
        return []
    closed = 100 * float((cycles.residuals < CLOSED_DEG).mean())
    median = degrees(float(np.median(cycles.residuals)))
    found = [
        f"Median residual of a triangle: {median}°; {closed:.0f} % close to within "
        f"{CLOSED_DEG:g}° (a random sample of {len(cycles.residuals)})."
    ]
    traces = [_histogram(cycles.residuals, "all triangles", "#0072B2")]
    wrong = case.at_truth[cycles.edges].max(axis=1) > WRONG_DEG
    if np.isfinite(share := agreeing_share(cycles, case.at_truth)):
        found.append(_agreement(share))
        traces.append(_histogram(cycles.residuals[wrong], f"with an edge over {WRONG_DEG:g}° off the truth", "#D55E00"))
    drawn: FigureDict = {
        "data": traces,
        "layout": {
            "xaxis": {"type": "log", "title": {"text": "residual of a triangle (°)"}, "exponentformat": "none"},
            "yaxis": {"title": {"text": "triangles (%)"}, "rangemode": "tozero"},
            "legend": {"orientation": "h", "y": 1, "yanchor": "bottom"},
            "height": 320,
        },
    }
    return [Section(anchor("cycles", case.name), "Residuals of cycles", tuple(found), drawn)]


def _agreement(share: float) -> str:
    about = f"Of the triangles with an edge that is more than {WRONG_DEG:g}° off the truth,"
    if share < NEXT_TO_NONE:
        return f"{about} next to none close as well as the others do: wrong edges do not agree with each other."
    return f"{about} about {100 * share:.0f} % close as well as the others do: wrong edges agree with each other."


def _histogram(residuals: Floats, name: str, color: str) -> dict[str, object]:
    counts, _ = np.histogram(np.clip(residuals, BINS[0], BINS[-1]), BINS)
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": np.sqrt(BINS[1:] * BINS[:-1]),
        "y": 100 * counts / len(residuals),
        "line": {"shape": "hvh", "color": color, "width": 1.5},
        "fill": "tozeroy",
        "hovertemplate": "%{y:.2~r} % at %{x:.3~r}°<extra></extra>",
    }


def roc_section(case: Case, looks: Looks) -> list[Section]:
    """Outliers that low edge weights catch; empty where the outliers are unknown or no method gives weights."""
    outliers = case.instance.outliers
    if outliers is None:
        return []
    traces = []
    for solved in case.solved:
        if solved.edge_weights is None:
            continue
        lost, caught = roc_curve(solved.edge_weights, outliers, points=60)
        if len(lost):
            line = {"color": looks[solved.key].color, "dash": dash(looks[solved.key]), "width": 1.8}
            name = f"{solved.label}: {area(float(solved.scores['roc_auc']))}"
            hover = "%{y:.1f} % of outliers for %{x:.1f} % of inliers<extra></extra>"
            trace = {"type": "scatter", "mode": "lines", "name": name, "x": 100 * lost, "y": 100 * caught}
            traces.append(trace | {"line": line, "hovertemplate": hover})
    if not traces:
        return []
    sentence = (
        f"{outliers.sum()} of the {len(outliers)} edges are known to be outliers. Where those of lowest weight are "
        "rejected first, a curve shows how many outliers are caught for how many inliers lost; further up and left is "
        "better. The number is the area under it."
    )
    axes = {"xaxis": {"title": {"text": "inliers rejected (%)"}}, "yaxis": {"title": {"text": "outliers rejected (%)"}}}
    drawn: FigureDict = {"data": traces, "layout": axes | {"height": 420, "showlegend": True}}
    return [Section(anchor("roc", case.name), "Do the edge weights know the outliers?", (sentence,), drawn)]


def cost_section(case: Case) -> list[Section]:
    """The optimum of the wrong cost, or stuck; empty where there is no truth."""
    if not case.has_truth:
        return []
    columns = ("cost_l1", "cost_l1_truth", "cost_l2", "cost_l2_truth")
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (s.label, *(float(s.scores[name]) for name in columns), _verdict(s)) for s in case.solved
    )
    head = ("Method", "l1", "l1 at the truth", "l2", "l2 at the truth", "Cost against the truth's")
    table = Table("Mean cost of an edge: l1 is the angle in radians, l2 the squared chordal distance", head, rows)
    return [
        Section(
            anchor("cost", case.name), "The cost at the estimate and at the truth", _cost_words(case), None, (table,)
        )
    ]


def _cost_words(case: Case) -> tuple[str, ...]:
    below = [s.label for s in case.solved if "lower" in _verdict(s)]
    above = [s.label for s in case.solved if _verdict(s) == "higher in both"]
    found = []
    if below:
        found.append(
            f"{_who(below, case)} explain the measurements better than the truth does, in l1 or in l2: what is wrong "
            "comes from the measurements and the cost, and a better search would not find the truth."
        )
    if above:
        found.append(
            f"{_who(above, case)} stopped above the truth's cost in both: stuck, or minimising something else."
        )
    return tuple(found)


def _who(labels: Sequence[str], case: Case) -> str:
    return "Every method" if len(labels) == len(case.solved) > 1 else words.enumeration(labels)


def _verdict(solved: Solved) -> str:
    ratios = [_ratio(solved, norm) for norm in ("l1", "l2")]
    lower, higher = ([r < 1 - SAME_COST for r in ratios], [r > 1 + SAME_COST for r in ratios])
    if all(lower):
        return "lower in both"
    if any(lower):
        return f"lower in {'l1' if lower[0] else 'l2'}"
    return "higher in both" if all(higher) else "the same"


def _ratio(solved: Solved, norm: str) -> float:
    own, truth = float(solved.scores[f"cost_{norm}"]), float(solved.scores[f"cost_{norm}_truth"])
    return own / truth if truth > 0 else math.inf if own > 0 else 1.0
