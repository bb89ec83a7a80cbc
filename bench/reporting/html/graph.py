"""The view graph drawn: cameras coloured by error, edges by residual, folds ringed.

The size of the page matters: coordinates are whole numbers below `GRID`, and of many edges a sample is drawn.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.core.problem import Floats, Ints, Problem
from bench.reporting.figures.paint_plotly import FigureDict
from bench.reporting.html.case import Solved
from bench.scoring.metrics.folds import Fold

GRID = 1000
EDGES = 300  # drawn of each figure
STEPS = 60  # of the springs
PULL = 4.0  # edges of a camera that pull with full strength; where it has more, each pulls less
REACH = 2.0  # ideal lengths of an edge, up to which cameras push each other away
NEARER = 0.8  # exponent of the distance from the middle: a few cameras far out leave room for the others
START = 10  # cameras; fewer start on a circle
ERRORS_DEG = (0.1, 0.3, 1, 3, 10, 30, 100)
# Blue to vermilion of Okabe and Ito's palette over a light grey: both ends stand out on white and on black.
COLORS = ("#0072B2", "#4292c6", "#9ecae1", "#c8c8c8", "#f0b27a", "#e58a3c", "#D55E00")
RINGS = ("#CC79A7", "#009E73", "#E69F00", "#56B4E9")
FITTING_DEG, FAR_DEG = 5.0, 15.0
GREY = "#808080"


def layout(problem: Problem) -> Ints:
    """Positions (n, 2) from 0 to `GRID`: springs along the edges (Fruchterman and Reingold 1991), spectral start.

    As in their grid variant, cameras push each other away only where they are near.
    """
    from scipy.spatial import KDTree

    n = problem.n
    positions = _spectral(problem) * np.sqrt(n) / 2  # an ideal edge has length 1
    ends, pull = problem.edges.T, min(1.0, PULL / float(problem.degree.mean()))
    for step in np.geomspace(1.0, 0.02, STEPS):
        near = KDTree(positions).query_pairs(REACH, output_type="ndarray").T
        moves = np.zeros((n, 2))
        for (i, j), pushes in ((near, True), (ends, False)):
            apart = positions[i] - positions[j]
            distance = np.maximum(np.linalg.norm(apart, axis=1, keepdims=True), 1e-3)
            force = apart / distance * (1 / distance if pushes else -pull * distance)
            for k in range(2):
                moves[:, k] += np.bincount(i, force[:, k], n) - np.bincount(j, force[:, k], n)
        length = np.linalg.norm(moves, axis=1, keepdims=True)
        positions = positions + moves * np.minimum(1, step / np.maximum(length, 1e-12))
    offset = positions - np.median(positions, axis=0)
    distance = np.linalg.norm(offset, axis=1, keepdims=True)
    positions = offset * np.maximum(distance, 1e-12) ** (NEARER - 1)
    low, high = positions.min(axis=0), positions.max(axis=0)
    return np.rint(GRID * (positions - low) / np.maximum(high - low, 1e-12)).astype(np.int32)


def figure(problem: Problem, positions: Ints, solved: Solved, colors: Floats, of: str) -> FigureDict:
    """The graph for one estimate.

    Parameters
    ----------
    problem
        The graph.
    positions
        (n, 2) from `layout`.
    solved
        The estimate: residuals of the edges, and folds.
    colors
        (n,) degrees, by which cameras are coloured; NaN is grey.
    of
        What they are, such as ``error``.
    """
    hidden: dict[str, Any] = {"visible": False}
    return {
        "data": [
            *_edges(problem, positions, solved.residuals),
            _cameras(positions, colors, of),
            _scale(of),
            *_rings(positions, solved.folds),
        ],
        "layout": {
            "xaxis": hidden | {"title": {"text": "x"}},
            "yaxis": hidden | {"title": {"text": "y"}, "scaleanchor": "x"},
            "height": 560,
            "hovermode": "closest",
            "legend": {"orientation": "h", "y": 0, "yanchor": "top"},
        },
    }


def _spectral(problem: Problem) -> Floats:
    """(n, 2) second and third eigenvector of the random walk on the graph, each scaled to at most 1."""
    from scipy import sparse
    from scipy.sparse.linalg import eigsh

    n = problem.n
    angles = 2 * np.pi * np.arange(n) / n
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    if n < START:
        return circle
    scale = 1 / np.sqrt(np.maximum(problem.degree, 1))
    walk = sparse.diags_array(scale) @ problem.adjacency() @ sparse.diags_array(scale)
    _, vectors = eigsh(walk, k=3, which="LA", v0=np.cos(np.arange(n)))  # eigenvalues ascend
    plane: Floats = vectors[:, 1::-1] * scale[:, None]
    return plane / np.abs(plane).max(axis=0) + 1e-3 * circle  # which parts cameras that coincide


def _edges(problem: Problem, positions: Ints, residuals: Floats) -> list[dict[str, Any]]:
    """A sample of the edges, in three layers by residual, the worst on top."""
    drawn = np.sort(np.random.default_rng(0).permutation(problem.m)[:EDGES])
    value = residuals[drawn]
    layers = (
        (~(value >= FITTING_DEG), f"edges below {FITTING_DEG:g}°", GREY, 0.35),
        ((value >= FITTING_DEG) & (value < FAR_DEG), f"{FITTING_DEG:g}° to {FAR_DEG:g}°", "#E69F00", 0.6),
        (value >= FAR_DEG, f"{FAR_DEG:g}° and more", "#D55E00", 0.7),
    )
    return [
        {
            "type": "scatter",
            "mode": "lines",
            "name": name,
            "x": _lines(positions[problem.edges[drawn[chosen]], 0]),
            "y": _lines(positions[problem.edges[drawn[chosen]], 1]),
            "line": {"color": color, "width": 0.8},
            "opacity": opacity,
            "hoverinfo": "skip",
        }
        for chosen, name, color, opacity in layers
        if chosen.any()
    ]


def _lines(ends: Ints) -> list[int | None]:
    """Ends (k, 2) one after the other, with a gap after each pair."""
    return [value for a, b in ends.tolist() for value in (a, b, None)]


def _cameras(positions: Ints, colors: Floats, of: str) -> dict[str, Any]:
    largest = ERRORS_DEG[-1]
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "cameras",
        "x": positions[:, 0],
        "y": positions[:, 1],
        "marker": {
            "color": [float(f"{value:.3g}") for value in colors],
            "cmin": 0,
            "cmax": largest,
            "colorscale": [[0, COLORS[0]], *([d / largest, c] for d, c in zip(ERRORS_DEG, COLORS, strict=True))],
            "showscale": False,  # its bar would be linear; the title is the head of the column in the CSV
            "colorbar": {"title": {"text": f"{of} (°)"}},
            "size": 7 if len(positions) < 600 else 5 if len(positions) < 2000 else 3,
            "line": {"width": 0.5, "color": GREY},
        },
        "showlegend": False,
        "hovertemplate": "camera %{pointNumber}<br>%{marker.color:.3~r}°<extra></extra>",
    }


def _scale(of: str) -> dict[str, Any]:
    """A trace without points whose bar explains the colours of the cameras, evenly spaced."""
    steps = len(ERRORS_DEG) - 1
    bar = {
        "orientation": "h",
        "y": 1,
        "yanchor": "bottom",
        "thickness": 10,
        "title": {"text": f"{of} of a camera (°)", "side": "top"},
        "tickvals": list(range(steps + 1)),
        "ticktext": [f"{degrees:g}" for degrees in ERRORS_DEG],
    }
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "scale",
        "x": [None],
        "y": [None],
        "marker": {
            "color": [0],
            "cmin": 0,
            "cmax": steps,
            "colorscale": [[k / steps, color] for k, color in enumerate(COLORS)],
            "colorbar": bar,
            "showscale": True,
        },
        "showlegend": False,
        "hoverinfo": "skip",
    }


def _rings(positions: Ints, folds: Sequence[Fold]) -> list[dict[str, Any]]:
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "name": f"turned by {fold.angle_deg:.1f}°: {len(fold.cameras)} cameras",
            "x": positions[fold.cameras, 0],
            "y": positions[fold.cameras, 1],
            "marker": {"symbol": "circle-open", "size": 12, "color": ring, "line": {"width": 1.5}},
            "customdata": fold.cameras,
            "hoverinfo": "skip",
        }
        for fold, ring in zip(folds, RINGS, strict=False)
    ]
