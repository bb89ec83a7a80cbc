"""Curves with error bands, a panel for each value of one parameter."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bench.papers.kinds.curves.plot import CurvePlot, Curves, Point
from bench.reporting.figures.looks import COLORS, LINES, Look
from bench.reporting.figures.style import describe, log_axis, panels, styled

REFERENCE = "#000000"
TICKS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)
WIDEST, THINNEST = 3.8, 0.9  # points; curves that coincide show as nested bands
REFERENCE_WIDTH = 0.9


def draw(found: Curves) -> Figure:
    """Draw the points of a figure; the vertical axis is logarithmic."""
    plot = found.plot
    looks = _looks(plot)
    low = float(np.nanmin([point.error_deg for point in found.rows])) / 1.6
    high = float(np.nanmax([point.error_deg + np.nan_to_num(point.half_width_deg) for point in found.rows])) * 1.2
    with styled():
        handles = [_line(look, width, [], []) for look, width in looks.values()]
        figure, axes = panels(len(plot.panel.values), 2.9, 2.7, handles)
        for ax, panel in zip(axes, plot.panel.values, strict=True):
            ax.set_title(plot.panel.label.format(panel), loc="left")
            for curve, (look, width) in looks.items():
                own = [point for point in found.rows if (point.panel, point.curve) == (panel, curve)]
                _curve(ax, own, look, width, low)
            ax.set_xlabel(plot.axis.label)
        axes[0].set(yscale="log", ylim=(low, high))
        axes[0].set_ylabel(f"{plot.statistic.removesuffix('_deg')} error (°)")
        for ax in axes:
            log_axis(ax.yaxis, low, high, TICKS)
        caption = f"{plot.dataset}, {found.computed.alignment} alignment."
        describe(figure, plot.title, " ".join([caption, *found.notes()]))
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


def _curve(ax: Axes, own: Sequence[Point], look: Look, width: float, low: float) -> None:
    x, mean = np.array([point.x for point in own]), np.array([point.error_deg for point in own])
    half = np.nan_to_num([point.half_width_deg for point in own])
    ax.fill_between(x, np.maximum(mean - half, low / 10), mean + half, color=look.color, alpha=0.2, linewidth=0)
    ax.add_line(_line(look, width, x.tolist(), mean.tolist()))
    ax.autoscale_view(scaley=False)


def _line(look: Look, width: float, x: Sequence[float], y: Sequence[float]) -> Line2D:
    return Line2D(x, y, color=look.color, linestyle=look.line, linewidth=width, label=look.label)
