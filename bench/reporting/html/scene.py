"""Forensics of one scene: parts turned as one piece, the graph, and what cycles, edge weights and costs say of it."""

import numpy as np

from bench.core.problem import Floats
from bench.reporting.figures.looks import Looks, looks_by_selection
from bench.reporting.html import graph
from bench.reporting.html.case import Case, Solved, gather
from bench.reporting.html.evidence import cost_section, cycle_section, roc_section
from bench.reporting.html.folding import fold_section
from bench.reporting.html.section import Section, Table, Value, anchor
from bench.scoring.results import Place, Results
from bench.storage.store import Store

MOST_CAMERAS = 6000  # of a graph that is drawn
BOTH = 300  # cameras up to which the worst estimate is drawn beside the best
WORST = 8  # cameras and edges that are listed


def sections(store: Store, results: Results, place: Place) -> list[Section]:
    """Everything that can be said of a scene beyond its scores; empty where nothing ended well."""
    case = gather(store, results, place)
    return [] if case is None else sections_of(case, looks_by_selection(results.frame))


def sections_of(case: Case, looks: Looks) -> list[Section]:
    """The same of what is known of it."""
    found = [*fold_section(case), *_graph_sections(case), *cycle_section(case)]
    return [*found, *roc_section(case, looks), *cost_section(case)]


def _graph_sections(case: Case) -> list[Section]:
    problem = case.instance.problem
    best, worst = case.solved[0], case.solved[-1]
    if problem.n > MOST_CAMERAS:
        sentence = f"A graph of more than {MOST_CAMERAS} cameras is not drawn."
        return [Section(anchor("graph", case.name), "The graph", (sentence,), None, _worst(case, best))]
    positions = graph.layout(problem)
    shown = [(best, "best")] if best is worst or problem.n > BOTH else [(best, "best"), (worst, "worst")]
    measure = "median error" if case.has_truth else "median residual"
    return [
        Section(
            anchor("graph", rank, case.name),
            f"The graph under {solved.label}, the {rank} by {measure}",
            _graph_words(case) if rank == "best" else (),
            graph.figure(problem, positions, solved, *_colors(case, solved)),
            _worst(case, solved),
        )
        for solved, rank in shown
    ]


def _graph_words(case: Case) -> tuple[str, ...]:
    problem = case.instance.problem
    edges = f"a random {graph.EDGES} of the {problem.m} edges" if problem.m > graph.EDGES else "all edges"
    color = "error" if case.has_truth else "the median residual of its edges, as there is no ground truth"
    rings = " Rings mark cameras that share one wrong rotation." if any(s.folds for s in case.solved) else ""
    seeds = " The first seed is shown." if case.several else ""
    return (
        f"A dot is a camera, coloured by {color}; what is joined by many edges is drawn together. Shown are {edges}, "
        f"coloured by residual at the estimate.{rings}{seeds}",
    )


def _colors(case: Case, solved: Solved) -> tuple[Floats, str]:
    return (
        (solved.errors, "error") if case.has_truth else (_camera_residuals(case, solved.residuals), "median residual")
    )


def _camera_residuals(case: Case, residuals: Floats) -> Floats:
    """(n,) median over the edges of each camera; NaN where none is known."""
    n = case.instance.problem.n
    cameras, values = case.instance.problem.edges.T.ravel(), np.tile(residuals, 2)
    known = np.isfinite(values)
    order = np.lexsort((values[known], cameras[known]))
    counts = np.bincount(cameras[known], minlength=n)
    starts = np.cumsum(counts) - counts
    ranked = values[known][order]
    out = np.full(n, np.nan)
    some = counts > 0
    low, high = (starts + (counts - 1) // 2)[some], (starts + counts // 2)[some]
    out[some] = (ranked[low] + ranked[high]) / 2
    return out


def _worst(case: Case, solved: Solved) -> tuple[Table, ...]:
    tables = [_worst_edges(case, solved)]
    return (_worst_cameras(case, solved), *tables) if case.has_truth else tuple(tables)


def _worst_cameras(case: Case, solved: Solved) -> Table:
    problem = case.instance.problem
    order = np.argsort(-np.nan_to_num(solved.errors, nan=-1), kind="stable")[:WORST]
    own, at_truth = _camera_residuals(case, solved.residuals), _camera_residuals(case, case.at_truth)
    in_pieces = bool(problem.components.any())
    rows: list[tuple[Value, ...]] = []
    for k in order:
        turned = next((f"{fold.angle_deg:.1f}°" for fold in solved.folds if k in fold.cameras), None)
        component = [int(problem.components[k])] if in_pieces else []
        numbers = (float(solved.errors[k]), float(own[k]), float(at_truth[k]))
        rows.append((int(k), int(problem.degree[k]), *numbers, turned, *component))
    head = ("Camera", "Edges", "Error °", "Median residual of its edges °", "At the truth °", "In a part turned by")
    caption = f"Worst cameras of {solved.label}"
    return Table(caption, (*head, "Component") if in_pieces else head, tuple(rows))


def _worst_edges(case: Case, solved: Solved) -> Table:
    problem, outliers = case.instance.problem, case.instance.outliers
    order = np.argsort(-np.nan_to_num(solved.residuals, nan=-1), kind="stable")[:WORST]
    rows: list[tuple[Value, ...]] = []
    for k in order:
        weight = [] if solved.edge_weights is None else [float(solved.edge_weights[k])]
        known = [] if outliers is None else ["yes" if outliers[k] else "no"]
        ends = " – ".join(map(str, problem.edges[k]))
        at_truth = [float(case.at_truth[k])] if case.has_truth else []
        rows.append((ends, float(solved.residuals[k]), *at_truth, *weight, *known))
    weighted = [] if solved.edge_weights is None else ["Weight"]
    truth = ["At the truth °"] if case.has_truth else []
    head = ("Edge", "Residual °", *truth, *weighted, *([] if outliers is None else ["Outlier"]))
    return Table(f"Worst edges of {solved.label}", head, tuple(rows))
