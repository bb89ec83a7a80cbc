"""Figures of the report as plotly dictionaries: error against time, spread, cumulative errors, iterations."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from bench.problem import Floats
from bench.reporting.report.section import FigureDict
from bench.reporting.report.standing import geometric_mean
from bench.reporting.style import LINES, Look, looks
from bench.results import Configured
from bench.scoring.oracle import Curve

Trace = dict[str, Any]
Looks = Mapping[Configured, Look]

DASHES = ("solid", "dash", "dot", "dashdot")
SYMBOLS = {
    "o": "circle",
    "s": "square",
    "^": "triangle-up",
    "D": "diamond",
    "v": "triangle-down",
    "P": "cross",
    "X": "x",
    "<": "triangle-left",
    ">": "triangle-right",
    "p": "pentagon",
}
GREY = "#808080"
FLOOR_DEG = 1e-3
FLOOR_S = 1e-4
SHARES = np.arange(0, 101, 2)  # percentiles of a cumulative curve
POINTS = 60  # of a curve over iterations
ERROR_AXIS = {"type": "log", "title": {"text": "error (°)"}, "exponentformat": "none"}
TIME_AXIS = {"type": "log", "title": {"text": "time to solve (s)"}, "exponentformat": "none"}


def looks_by_selection(frame: pd.DataFrame) -> dict[Configured, Look]:
    """Looks of the project's figures, each method called by the selection that runs it."""
    return {
        (method, params): Look(f"{method}[{params}]" if params else method, look.color, look.line, look.marker)
        for (method, params), look in looks(frame).items()
    }


def against_time(points: Mapping[Configured, tuple[float, float]], look: Looks) -> FigureDict:
    """Median error against time, one marker a method, with the steps of the Pareto frontier.

    Parameters
    ----------
    points
        Seconds and degrees of each configured method.
    look
        How each is drawn.
    """
    shown = {key: (max(s, FLOOR_S), max(e, FLOOR_DEG)) for key, (s, e) in points.items()}
    best: list[tuple[float, float]] = []
    for time, error in sorted(shown.values()):
        if not best or error < best[-1][1]:
            best.append((time, error))
    frontier = {
        "type": "scatter",
        "mode": "lines",
        "name": "Pareto frontier",
        "x": [time for time, _ in best],
        "y": [error for _, error in best],
        "line": {"shape": "hv", "color": GREY, "width": 1},
        "hoverinfo": "skip",
    }
    traces = [
        {
            "type": "scatter",
            "mode": "markers",
            "name": look[key].label,
            "x": [time],
            "y": [error],
            "marker": {"symbol": SYMBOLS[look[key].marker], "color": look[key].color, "size": 10},
            "hovertemplate": "%{fullData.name}<br>%{y:.3g}° in %{x:.3g} s<extra></extra>",
        }
        for key, (time, error) in shown.items()
    ]
    layout = {"xaxis": TIME_AXIS, "yaxis": ERROR_AXIS | {"title": {"text": "median error (°)"}}, "height": 460}
    return {"data": [frontier, *traces], "layout": layout}


def spread(errors: Mapping[Configured, Iterable[Floats]], look: Looks) -> FigureDict:
    """Quartiles, 10th and 90th percentile, median and mean of the errors of each method, a line a method."""
    traces = []
    for key, style in look.items():
        values = np.maximum(pooled(errors.get(key, ())), FLOOR_DEG)
        if len(values):
            p10, q1, median, q3, p90 = ([float(v)] for v in np.percentile(values, [10, 25, 50, 75, 90]))
            traces.append(
                {
                    "type": "box",
                    "orientation": "h",
                    "name": style.label,
                    "y": [style.label],
                    "lowerfence": p10,
                    "q1": q1,
                    "median": median,
                    "q3": q3,
                    "upperfence": p90,
                    "mean": [float(values.mean())],
                    "marker": {"color": style.color},
                    "line": {"width": 1.5},
                }
            )
    layout = {
        "xaxis": ERROR_AXIS | {"title": {"text": "error of a camera (°)"}},
        "yaxis": {"autorange": "reversed", "automargin": True, "type": "category"},
        "showlegend": False,
        "height": 130 + 26 * len(traces),
        "hovermode": "y",
    }
    return {"data": traces, "layout": layout}


def cumulative(quantiles: Mapping[Configured, Floats], look: Looks, shown: Iterable[Configured]) -> FigureDict:
    """Share of the scored cameras under an angle, one curve a method.

    Parameters
    ----------
    quantiles
        For each configured method, the errors in degrees at `SHARES` percent of the cameras.
    look
        How each is drawn.
    shown
        The methods that are visible at first; the others are switched on in the legend.
    """
    visible = set(shown)
    traces = [
        {
            "type": "scatter",
            "mode": "lines",
            "name": style.label,
            "x": np.maximum(quantiles[key], FLOOR_DEG),
            "y0": 0,
            "dy": int(SHARES[1]),
            "visible": None if key in visible else "legendonly",
            "line": {"color": style.color, "dash": dash(style), "width": 1.8},
            "hovertemplate": "%{fullData.name}<br>%{y} % of cameras under %{x:.3g}°<extra></extra>",
        }
        for key, style in look.items()
        if key in quantiles
    ]
    everything = np.concatenate([quantiles[key] for key in quantiles]) if quantiles else np.ones(1)
    low = math.log10(max(float(np.percentile(everything, 2)), FLOOR_DEG))
    layout = {
        "xaxis": ERROR_AXIS | {"title": {"text": "angle (°)"}, "range": [low, math.log10(180)]},
        "yaxis": {"title": {"text": "cameras under it (%)"}, "range": [0, 101]},
        "height": 460,
    }
    return {"data": traces, "layout": layout}


def quantiles_of(errors: Iterable[Floats]) -> Floats | None:
    """Errors at `SHARES` percent of the scored cameras of all seeds; None where nothing was scored."""
    values = pooled(errors)
    return np.percentile(values, SHARES) if len(values) else None


def over_iterations(curves: Mapping[Configured, Sequence[Curve]], look: Looks) -> FigureDict:
    """Mean error along the checkpoints, a curve for each seed of a method."""
    traces = []
    for key, of_seeds in curves.items():
        for k, curve in enumerate(of_seeds):
            kept = np.unique(np.linspace(0, len(curve.iterations) - 1, POINTS).astype(int))
            traces.append(
                {
                    "type": "scatter",
                    "mode": "lines+markers",
                    "name": look[key].label,
                    "legendgroup": look[key].label,
                    "showlegend": k == 0,
                    "x": curve.iterations[kept],
                    "y": np.maximum(curve.mean_deg[kept], FLOOR_DEG),
                    "customdata": curve.seconds[kept],
                    "line": {"color": look[key].color, "dash": dash(look[key]), "width": 1.5},
                    "marker": {"size": 4},
                    "hovertemplate": "%{fullData.name}<br>%{y:.3g}° at %{x}, %{customdata:.3g} s<extra></extra>",
                }
            )
    layout = {
        "xaxis": {"title": {"text": "iteration"}},
        "yaxis": ERROR_AXIS | {"title": {"text": "mean error (°)"}},
        "height": 400,
    }
    return {"data": traces, "layout": layout}


def by_scene(
    scenes: Sequence[str], methods: Sequence[str], medians: Floats, statuses: Sequence[Sequence[str]]
) -> FigureDict:
    """Median error of each method on each scene, as numbers on colours.

    Parameters
    ----------
    scenes, methods
        Names, left to right and top to bottom.
    medians
        (methods, scenes) degrees, NaN where a method has none.
    statuses
        What is written where there is none.
    """
    written = [
        [f"{value:.2g}" if math.isfinite(value) else status for value, status in zip(row, why, strict=True)]
        for row, why in zip(medians.tolist(), statuses, strict=True)
    ]
    with np.errstate(invalid="ignore"):
        logs = np.log10(np.maximum(medians, FLOOR_DEG))
    ticks = [
        t for t in (0.001, 0.01, 0.1, 0.3, 1, 3, 10, 30, 100) if np.nanmin(logs) <= math.log10(t) <= np.nanmax(logs)
    ]
    trace = {
        "type": "heatmap",
        "x": list(scenes),
        "y": list(methods),
        "z": logs,
        "text": written,
        "texttemplate": "%{text}",
        "colorscale": "Viridis",
        "reversescale": True,
        "xgap": 2,
        "ygap": 2,
        "hoverongaps": False,
        "hovertemplate": "%{y}<br>%{x}: %{text}°<extra></extra>",
        "colorbar": {"title": {"text": "median °"}, "tickvals": [math.log10(t) for t in ticks], "ticktext": ticks},
    }
    layout = {
        "xaxis": {"side": "top", "type": "category", "automargin": True, "showgrid": False},
        "yaxis": {"autorange": "reversed", "type": "category", "automargin": True, "showgrid": False},
        "height": 170 + 26 * len(methods),
    }
    return {"data": [trace], "layout": layout}


def mean_quantiles(of_scenes: Sequence[Floats]) -> Floats:
    """Geometric mean over scenes of the errors at each share of the cameras."""
    stacked = np.array(of_scenes)
    return np.array([geometric_mean(column) for column in stacked.T])


def pooled(errors: Iterable[Floats]) -> Floats:
    """Finite errors of all seeds together."""
    values: Floats = np.concatenate([np.empty(0), *errors])
    return values[np.isfinite(values)]


def dash(look: Look) -> str:
    """Plotly's name of a line style."""
    return DASHES[LINES.index(look.line) % len(DASHES)] if look.line in LINES else DASHES[0]
