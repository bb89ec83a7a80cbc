"""Curves with error bands, a panel for each value of one parameter."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bench.papers.items.curves import CurvePlot
from bench.reporting.figures.looks import COLORS, LINES, Look
from bench.reporting.figures.style import describe, log_axis, panels, styled

REFERENCE = "#000000"
TICKS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)
WIDEST, THINNEST = 3.8, 0.9  # points; curves that coincide show as nested bands
REFERENCE_WIDTH = 0.9


def draw(plot: CurvePlot, points: pd.DataFrame, alignment: str, notes: tuple[str, ...]) -> Figure:
    """Draw the points of a figure, see `CurvePlot.points`; the vertical axis is logarithmic."""
    looks = _looks(plot)
    low = points[plot.statistic].min() / 1.6
    high = (points[plot.statistic] + points["half_width_deg"].fillna(0)).max() * 1.2
    with styled():
        handles = [_line(look, width, [], []) for look, width in looks.values()]
        figure, axes = panels(len(plot.panel.values), 2.9, 2.7, handles)
        for ax, panel in zip(axes, plot.panel.values, strict=True):
            ax.set_title(plot.panel.label.format(panel), loc="left")
            for curve, (look, width) in looks.items():
                own = points[(points[plot.panel.parameter] == panel) & (points["curve"] == curve)]
                _curve(ax, own, plot, look, width, low)
            ax.set_xlabel(plot.axis.label)
        axes[0].set(yscale="log", ylim=(low, high))
        axes[0].set_ylabel(f"{plot.statistic.removesuffix('_deg')} error (°)")
        for ax in axes:
            log_axis(ax.yaxis, low, high, TICKS)
        describe(figure, plot.title, " ".join([f"{plot.dataset}, {alignment} alignment.", *notes]))
    return figure


def _looks(plot: CurvePlot) -> dict[str, tuple[Look, float]]:
    """Contestants in colours, from wide to thin; reference lines in black, each with its own dashes."""
    contestants = [curve.label for curve in plot.curves if not curve.reference]
    references = [curve.label for curve in plot.curves if curve.reference]
    widths = np.linspace(WIDEST, THINNEST, len(contestants))
    looks = {
        label: (Look(label, COLORS[k % len(COLORS)], "-", ""), float(width))
        for k, (label, width) in enumerate(zip(contestants, widths, strict=True))
    }
    for k, label in enumerate(references):
        looks[label] = (Look(label, REFERENCE, LINES[1 + k % (len(LINES) - 1)], ""), REFERENCE_WIDTH)
    return looks


def _curve(ax: Axes, own: pd.DataFrame, plot: CurvePlot, look: Look, width: float, low: float) -> None:
    x, mean = own[plot.axis.parameter].to_numpy(), own[plot.statistic].to_numpy()
    half = own["half_width_deg"].fillna(0).to_numpy()
    ax.fill_between(x, np.maximum(mean - half, low / 10), mean + half, color=look.color, alpha=0.2, linewidth=0)
    ax.add_line(_line(look, width, x.tolist(), mean.tolist()))
    ax.autoscale_view(scaley=False)


def _line(look: Look, width: float, x: Sequence[float], y: Sequence[float]) -> Line2D:
    return Line2D(x, y, color=look.color, linestyle=look.line, linewidth=width, label=look.label)
