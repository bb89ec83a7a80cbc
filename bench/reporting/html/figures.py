"""Figures of the report as plotly dictionaries: error against time, spread, cumulative errors, iterations."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from bench.core.problem import Floats
from bench.reporting.figures.style import LINES, Look, looks
from bench.reporting.html.embed import compact
from bench.reporting.html.section import FigureDict
from bench.reporting.html.standing import geometric_mean
from bench.reporting.tables.rows import degrees
from bench.scoring.metrics.oracle import Curve
from bench.scoring.results import Configured

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
LOG_AXIS = {"type": "log", "minorloglabels": "complete", "exponentformat": "none"}
SHORT = 0.9  # decades
WORST = 10.0  # times the best median, from which on colours do not change


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
        "mode": "lines",
        "name": "Pareto frontier",
        "x": [time for time, _ in best],
        "y": [error for _, error in best],
        "line": {"shape": "hv", "color": GREY, "width": 1},
        "hoverinfo": "skip",
    }
    traces = [
        {
            "mode": "markers+text",
            "name": look[key].label,
            "text": [look[key].label] if (time, error) in best else None,
            "x": [time],
            "y": [error],
            "marker": {"symbol": SYMBOLS[look[key].marker], "color": look[key].color},
        }
        for key, (time, error) in shown.items()
    ]
    layout = {
        "xaxis": log_axis("time to solve (s)", [time for time, _ in shown.values()]),
        "yaxis": log_axis("median error (°)", [error for _, error in shown.values()]),
        "height": tall(len(traces) + 1),
        "template": every_scatter(
            "%{fullData.name}<br>%{y:.3g}° in %{x:.3g} s", textposition="bottom right", marker={"size": 10}
        ),
    }
    return {"data": [frontier, *traces], "layout": layout}


def spread(errors: Mapping[Configured, Iterable[Floats]], look: Looks) -> FigureDict:
    """Quartiles, 10th and 90th percentile, median and mean of the errors of each method, a line a method."""
    traces = []
    drawn: list[float] = []
    for key, style in look.items():
        values = np.maximum(pooled(errors.get(key, ())), FLOOR_DEG)
        if len(values):
            p10, q1, median, q3, p90 = ([float(v)] for v in np.percentile(values, [10, 25, 50, 75, 90]))
            drawn += [*p10, *p90, float(values.mean())]
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
        "xaxis": log_axis("error of a camera (°)", drawn),
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
        For each configured method, in the order of the legend, the errors in degrees at `SHARES` percent of the
        cameras.
    look
        How each is drawn.
    shown
        The methods that are visible at first; the others are switched on in the legend.
    """
    visible = set(shown)
    traces = [
        {
            "name": style.label,
            "x": compact(np.maximum(quantiles[key], FLOOR_DEG), 3),
            "visible": None if key in visible else "legendonly",
            "line": {"color": style.color, "dash": dash(style)},
        }
        for key, style in ((key, look[key]) for key in quantiles)
    ]
    everything = np.maximum(np.concatenate([np.ones(0), *quantiles.values()]), FLOOR_DEG)
    layout = {
        "xaxis": log_axis("angle (°)", np.percentile(everything, [2, 100])),
        "yaxis": {"title": {"text": "cameras under it (%)"}, "range": [0, 101]},
        "height": tall(len(traces)),
        "template": every_scatter(
            "%{fullData.name}<br>%{y} % of cameras under %{x:.3g}°", mode="lines", y0=0, dy=int(SHARES[1])
        ),
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
                    "name": look[key].label,
                    "legendgroup": look[key].label,
                    "showlegend": k == 0,
                    "x": curve.iterations[kept],
                    "y": np.maximum(curve.mean_deg[kept], FLOOR_DEG),
                    "customdata": curve.seconds[kept],
                    "line": {"color": look[key].color, "dash": dash(look[key])},
                }
            )
    layout = {
        "xaxis": {"title": {"text": "iteration"}},
        "yaxis": log_axis("mean error (°)", [y for trace in traces for y in trace["y"]]),
        "height": tall(len(curves)),
        "template": every_scatter(
            "%{fullData.name}<br>%{y:.3g}° at iteration %{x}, after %{customdata:.3g} s",
            mode="lines+markers",
            marker={"size": 4},
        ),
    }
    return {"data": traces, "layout": layout}


def by_scene(
    scenes: Sequence[str], methods: Sequence[str], medians: Floats, statuses: Sequence[Sequence[str]]
) -> FigureDict:
    """Median error of each method on each scene: numbers, on colours for the ratio to the scene's best.

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
        [degrees(value) if math.isfinite(value) else status for value, status in zip(row, why, strict=True)]
        for row, why in zip(medians.tolist(), statuses, strict=True)
    ]
    floored = np.maximum(medians, FLOOR_DEG)  # NaN stays
    trace = {
        "type": "heatmap",
        "x": list(scenes),
        "y": list(methods),
        "z": np.log(floored / np.nanmin(floored, axis=0)),
        "zmin": 0,
        "zmax": math.log(WORST),
        "customdata": medians,
        "text": written,
        "texttemplate": "%{text}",
        "colorscale": [[0, "#eef5fb"], [1, "#6ea6d8"]],
        "textfont": {"color": "#16191d"},
        "showscale": False,
        "name": "median error (°)",
        "xgap": 2,
        "ygap": 2,
        "hovertemplate": "%{y}<br>%{x}: %{text}<extra></extra>",
    }
    layout = {
        "xaxis": {"side": "top", "type": "category", "showgrid": False, "tickangle": -40 if len(scenes) > 8 else 0},
        "yaxis": {"autorange": "reversed", "type": "category", "showgrid": False},
        "plot_bgcolor": "#e4e7ea",
        "height": 110 + 26 * len(methods) + 60 * (len(scenes) > 8),
        "margin": {"r": 60} if len(scenes) > 8 else None,
        "meta": {"width": 200 + 42 * len(scenes)},
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


def tall(entries: int) -> int:
    """Height at which a legend of so many entries needs no scrolling."""
    return max(440, 70 + 19 * entries)


def every_scatter(hover: str, **more: Any) -> dict[str, Any]:
    """A plotly template: what the traces of a figure share is written once. The hover text must hold no names."""
    return {"data": {"scatter": [{"hovertemplate": f"{hover}<extra></extra>", "line": {"width": 1.8}, **more}]}}


def log_axis(title: str, values: Iterable[float]) -> dict[str, Any]:
    """A logarithmic axis around the values, with plain numbers at 1, 2 and 5, or at every digit of a short one."""
    logs = np.log10(list(values) or [1.0])
    low, high = float(logs.min()), float(logs.max())
    margin = max(0.06 * (high - low), 0.12)
    ticks = {"dtick": "D1" if high - low < SHORT else "D2"}
    return LOG_AXIS | ticks | {"title": {"text": title}, "range": [low - margin, high + margin]}


def dash(look: Look) -> str:
    """Plotly's name of a line style."""
    return DASHES[LINES.index(look.line) % len(DASHES)] if look.line in LINES else DASHES[0]
