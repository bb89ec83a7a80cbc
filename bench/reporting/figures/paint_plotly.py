"""Figures as plotly dictionaries, for the page: those of one panel."""

import math
import re
from collections.abc import Callable, Collection
from typing import Any

from bench.reporting.figures.data import RULER, Axis, Chart, Drawing, Heat, Leader, MeanRanks, Series, Spreads
from bench.reporting.figures.looks import GREY, Look

FigureDict = dict[str, Any]  # {"data": [trace, …], "layout": {…}}

WIDTH = 1.8  # of a line, pixels
MARKS = 6  # on a curve
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
    "*": "star",
    "d": "diamond-tall",
    "h": "hexagon",
    "H": "hexagon2",
    "8": "octagon",
    "+": "cross-thin-open",
    "x": "x-thin-open",
}
DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}
LOG = {"type": "log", "minorloglabels": "complete", "exponentformat": "none"}
SHORT = 0.9  # decades
SPREAD = "Box: quartiles and median; whiskers: 10th and 90th percentile; dashes: the mean."
CHARACTER, LINE = 6.8, 22  # pixels, of a name
LEAST_AXIS = 240  # pixels between the names
MOST_RANKS = 15  # that are written at an axis
CATEGORIES = {"autorange": "reversed", "automargin": True, "type": "category"}


def paint(drawing: Drawing, shown: Collection[str] | None = None) -> FigureDict:
    """Draw the first panel of whatever figure it is.

    Parameters
    ----------
    drawing
        The figure.
    shown
        Labels of the curves that are visible at first, all by default; the legend switches the others on.
    """
    figure = _PAINTERS[type(drawing)](drawing)
    for trace in figure["data"]:
        if shown is not None and trace["name"] not in shown:
            trace["visible"] = "legendonly"
    return figure


def dash(look: Look) -> str:
    """Plotly's name of a line style, or lengths in pixels."""
    if isinstance(look.line, str):
        return DASHES.get(look.line, "solid")
    return ",".join(f"{WIDTH * length:.3g}px" for length in look.line[1])


def axis(of: Axis) -> dict[str, Any]:
    """An axis; a logarithmic one has plain numbers at 1, 2 and 5, or at every digit where it is short."""
    if not of.log:
        return {"title": {"text": of.title}, "range": list(of.ends)}
    low, high = map(math.log10, of.ends)
    ticks = {"dtick": "D1" if high - low < SHORT else "D2"}
    return LOG | ticks | {"title": {"text": of.title}, "range": [low, high]}


def _chart(chart: Chart) -> FigureDict:
    panel = chart.panels[0]
    seen: set[str] = set()
    traces = []
    for s in panel.series:
        traces.append(_series(s, first=s.look.label not in seen))
        seen.add(s.look.label)
    traces += _rings(chart)
    reading = re.sub(r"\{(?=[xy])", "%{", chart.reading).replace("{0}", "%{customdata}").replace("{1}", "%{text}")
    layout = {
        "xaxis": axis(chart.x),
        "yaxis": axis(chart.y),
        "height": max(440, 70 + 19 * len(seen)),  # a legend that needs no scrolling
        # What all traces share is written once; it must hold no names.
        "template": {"data": {"scatter": [{"hovertemplate": f"%{{fullData.name}}<br>{reading}<extra></extra>"}]}},
    }
    return {"data": traces, "layout": layout}


def _series(s: Series, first: bool) -> dict[str, Any]:
    look, points, shape = s.look, s.kind == "points", "hv" if s.kind == "steps" else "linear"
    trace: dict[str, Any] = {"name": look.label, "legendgroup": look.label, "showlegend": first, "x": s.x, "y": s.y}
    trace |= dict(zip(("customdata", "text"), s.facts, strict=False))
    if not look.marker:
        thin = {"shape": shape, "color": look.color, "width": 1}
        return trace | {"mode": "lines", "line": thin, "hoverinfo": "skip"}
    marker = {"symbol": SYMBOLS.get(look.marker, "circle"), "color": look.color, "size": 10 if points else 6}
    if points:
        named = {"text": [look.label], "textposition": "bottom right"} if s.named else {}
        return trace | {"mode": "markers+text" if s.named else "markers", "marker": marker} | named
    line = {"shape": shape, "color": look.color, "dash": dash(look), "width": WIDTH}
    return trace | {"mode": "lines+markers", "marker": marker | {"maxdisplayed": MARKS}, "line": line}


def _rings(chart: Chart) -> list[dict[str, Any]]:
    ringed = [(s, s.ring) for s in chart.panels[0].series if s.ring is not None]
    x, y = [float(s.x[k]) for s, k in ringed], [float(s.y[k]) for s, k in ringed]
    marker = {"symbol": "circle-open", "size": 12, "color": GREY}
    trace = {"mode": "markers", "name": chart.ring, "x": x, "y": y, "marker": marker, "hoverinfo": "skip"}
    return [trace] if ringed else []


def _spreads(drawn: Spreads) -> FigureDict:
    rows = [row for row in drawn.panels[0][1] if len(row.quantiles)]
    ends = ("lowerfence", "q1", "median", "q3", "upperfence")
    traces = [
        {
            "type": "box",
            "orientation": "h",
            "name": row.look.label,
            "y": [row.look.label],
            **{name: [value] for name, value in zip(ends, row.quantiles.tolist(), strict=True)},
            "mean": [row.mean],
            "marker": {"color": row.look.color},
            "line": {"width": 1.5},
        }
        for row in rows
    ]
    layout = {
        "xaxis": axis(drawn.x),
        "yaxis": CATEGORIES,
        "showlegend": False,
        "height": 130 + 26 * len(rows),
        "hovermode": "y",
    }
    return {"data": traces, "layout": layout}


def _heat(heat: Heat) -> FigureDict:
    many = len(heat.columns) > 8 and max(map(len, heat.columns)) > 3
    trace = {
        "type": "heatmap",
        "x": heat.columns,
        "y": heat.rows,
        "z": heat.shades,
        "zmin": 0,
        "zmax": 1,
        "customdata": heat.cells,
        "text": heat.texts,
        "texttemplate": "%{text}",
        "colorscale": [[0, "#eef5fb"], [1, "#6ea6d8"]],
        "textfont": {"color": "#16191d"},
        "showscale": False,
        "name": heat.values,
        "xgap": 2,
        "ygap": 2,
        "hovertemplate": f"%{{y}}<br>{heat.x} %{{x}}: %{{customdata:.3~r}}<extra></extra>",
    }
    top = {"side": "top", "type": "category", "showgrid": False, "tickangle": -40 if many else 0}
    layout = {
        "xaxis": top,
        "yaxis": CATEGORIES | {"showgrid": False},
        "plot_bgcolor": "#e4e7ea",
        "height": 110 + 26 * len(heat.rows) + 60 * many,
        "margin": {"r": 60} if many else None,
        "meta": {"width": 200 + 42 * len(heat.columns)},
    }
    return {"data": [trace], "layout": layout}


def _mean_ranks(drawn: MeanRanks) -> FigureDict:
    """The axis at height 0, its ticks above; lines and names are shapes and annotations, which no legend lists."""
    low, high = -drawn.depth, RULER + 1.2
    leaders = drawn.leaders
    marks = {
        "type": "scatter",
        "mode": "markers",
        "name": "mean rank",
        "x": drawn.ranks,
        "y": [0.0] * len(leaders),
        "text": [leader.look.label for leader in leaders],
        "marker": {
            "color": [leader.look.color for leader in leaders],
            "symbol": [SYMBOLS.get(leader.look.marker, "circle") for leader in leaders],
            "size": 9,
        },
        "cliponaxis": False,
        "hovertemplate": "%{text}: mean rank %{x:.2f}<extra></extra>",
    }
    bars = [
        {
            "type": "scatter",
            "mode": "lines",
            "name": "not told apart",
            "x": [bar.low, bar.high],
            "y": [bar.y, bar.y],
            "line": {"width": 5, "color": "#000000"},
            "cliponaxis": False,
            "hoverinfo": "skip",
        }
        for bar in drawn.bars
    ]
    wide = 12 + CHARACTER * max(len(leader.text) for leader in leaders)
    layout = {
        "xaxis": {
            "range": list(drawn.ends),
            "side": "top",
            "anchor": "free",
            "position": -low / (high - low),
            "dtick": -(-len(leaders) // MOST_RANKS),
            "tick0": 1,
            "ticks": "outside",
            "tickcolor": "#000000",
            "linecolor": "#000000",
            "showline": True,
            "showgrid": False,
            "zeroline": False,
            "automargin": False,
            "fixedrange": True,
        },
        "yaxis": {"range": [low, high], "visible": False, "fixedrange": True},
        "shapes": [shape for leader in leaders for shape in _leader(leader)]
        + [_straight(*drawn.ruler, RULER, "#000000", 2)],
        "annotations": [*map(_name, leaders), _difference(drawn)],
        "height": int(LINE * (high - low)) + 20,
        "showlegend": False,
        "margin": {"l": wide, "r": wide, "t": 10, "b": 10},
        "meta": {"width": int(2 * wide + LEAST_AXIS)},
    }
    return {"data": [*bars, marks], "layout": layout}


def _leader(leader: Leader) -> list[dict[str, Any]]:
    """Down from the axis, then out to the name."""
    down = {"type": "line", "x0": leader.rank, "x1": leader.rank, "y0": 0, "y1": leader.y}
    return [
        down | {"line": {"color": leader.look.color, "width": 1.4}, "layer": "below"},
        _straight(leader.rank, leader.end, leader.y, leader.look.color, 1.4),
    ]


def _straight(start: float, end: float, y: float, color: str, width: float) -> dict[str, Any]:
    line = {"color": color, "width": width}
    return {"type": "line", "x0": start, "x1": end, "y0": y, "y1": y, "line": line, "layer": "below"}


def _name(leader: Leader) -> dict[str, Any]:
    side, shift = ("right", -5) if leader.left else ("left", 5)
    return {"x": leader.end, "y": leader.y, "text": leader.text, "xanchor": side, "xshift": shift, "showarrow": False}


def _difference(drawn: MeanRanks) -> dict[str, Any]:
    text = f"critical difference {drawn.difference:.2f}"
    place = {"x": drawn.ruler[0], "y": RULER, "xanchor": "left", "yanchor": "bottom", "yshift": 2}
    return place | {"text": text, "showarrow": False}


_PAINTERS: dict[type[Drawing], Callable[..., FigureDict]] = {
    Chart: _chart,
    Spreads: _spreads,
    Heat: _heat,
    MeanRanks: _mean_ranks,
}
