"""Figures drawn by matplotlib, for files."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from bench.reporting.figures.data import RULER, Axis, Chart, Drawing, Heat, Leader, MeanRanks, Series, Spread, Spreads
from bench.reporting.figures.looks import GREY, Look
from bench.reporting.figures.style import columns_of, describe, log_axis, panels, styled

SHADES = LinearSegmentedColormap.from_list("shades", ["#eef5fb", "#6ea6d8"])
SPREAD = "Thick: quartiles; thin: 10th to 90th percentile; dot: median; white diamond: mean."
ROW = 0.19  # inches
MARKS = 5  # on a curve
LARGER = {"*": 1.5, "d": 1.2, "P": 1.1, "X": 1.1}  # markers that look smaller than others of their size


def paint(drawing: Drawing) -> Figure:
    """Draw whatever figure it is; the caption of one that stands alone names the rules too."""
    with styled():
        figure = _PAINTERS[type(drawing)](drawing)
        how = SPREAD if isinstance(drawing, Spreads) else ""
        describe(figure, drawing.title, " ".join(filter(None, (how, drawing.caption, drawing.rules))))
    return figure


def _chart(chart: Chart) -> Figure:
    of = {s.look.label: s for panel in chart.panels for s in panel.series}
    handles = [_line(s, [], []) for s in of.values()]
    if chart.ring:
        handles.append(Line2D([], [], color=GREY, marker="o", fillstyle="none", linestyle="", label=chart.ring))
    figure, axes = panels(len(chart.panels), *chart.size, handles)
    for ax, panel in zip(axes, chart.panels, strict=True):
        ax.set_title(panel.title, loc="left")
        for k, s in enumerate(panel.series):
            line = _line(s, s.x, s.y)
            if s.kind != "points":
                line.set_markevery(_marks(k, len(s.x)))
            ax.add_line(line)
            if s.ring is not None:
                ax.plot(s.x[s.ring], s.y[s.ring], "o", color=s.look.color, fillstyle="none", markersize=6)
    _scale(axes, chart.x, chart.y)
    return figure


def _line(s: Series, x: object, y: object) -> Line2D:
    points = s.kind == "points"
    return Line2D(
        x,  # type: ignore[arg-type]
        y,  # type: ignore[arg-type]
        label=s.look.label,
        color=s.look.color,
        linestyle="" if points else s.look.line,
        linewidth=1.1 if s.look.marker else 0.8,
        drawstyle="steps-post" if s.kind == "steps" else "default",
        marker=s.look.marker,
        markersize=(5.5 if points else 3.5) * LARGER.get(s.look.marker, 1),
        markeredgewidth=0.3,
        markeredgecolor="white",
        zorder=2 if s.look.marker else 1,
    )


def _marks(k: int, points: int) -> tuple[int, int]:
    """First marker of a curve and their distance: those of curves that lie on each other are apart."""
    every = max(1, points // MARKS)
    return (k * max(1, every // MARKS)) % every, every


def _scale(axes: Sequence[Axes], x: Axis, y: Axis) -> None:
    axes[0].set(xlim=x.ends, ylim=y.ends, xscale="log" if x.log else "linear", yscale="log" if y.log else "linear")
    columns = columns_of(len(axes))
    for ax in axes:
        for side, axis in ((ax.xaxis, x), (ax.yaxis, y)):
            if axis.log:
                log_axis(side, *axis.ends, _ticks(*axis.ends))
    for ax in axes[-columns:]:
        ax.set_xlabel(x.title)
    for ax in axes[::columns]:
        ax.set_ylabel(y.title)


def _ticks(low: float, high: float) -> list[float]:
    """Round values: 1, 2 and 5, or fewer of a decade where there are many decades."""
    decades = math.log10(high / low)
    steps = (1, 2, 5) if decades < 2 else (1, 3) if decades < 3.5 else (1,)
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [step * 10.0**power for power in powers for step in steps]


def _spreads(drawn: Spreads) -> Figure:
    looks = [row.look for row in drawn.panels[0][1]]
    figure, axes = panels(len(drawn.panels), 2.3, ROW * _lines(looks) * len(looks) + 0.55, ())
    for ax, (title, rows) in zip(axes, drawn.panels, strict=True):
        ax.set_title(title, loc="left")
        for k, row in enumerate(rows):
            _spread(ax, k, row)
        ax.grid(visible=False, axis="y")
        ax.tick_params(axis="y", length=0)
    _scale(axes, drawn.x, Axis("", (len(looks) - 0.5, -0.5)))
    axes[0].set_yticks(range(len(looks)), [look.label for look in looks])
    return figure


def _spread(ax: Axes, k: int, row: Spread) -> None:
    if row.remark:
        place = ax.get_yaxis_transform()
        ax.text(0.03, k, row.remark, transform=place, va="center", color=GREY, fontsize=7)
        return
    color = row.look.color
    p10, p25, p50, p75, p90 = row.quantiles
    ax.plot([p10, p90], [k, k], color=color, linewidth=0.9, solid_capstyle="butt")
    ax.plot([p25, p75], [k, k], color=color, linewidth=4, solid_capstyle="butt", alpha=0.55)
    ax.plot(p50, k, marker="o", color=color, markersize=4.5)
    (mean,) = ax.plot(row.mean, k, marker="D", color="white", markersize=3.2)
    mean.set(markeredgecolor=color, markeredgewidth=0.8)


def _heat(heat: Heat) -> Figure:
    rows, columns = heat.shades.shape
    lines = max(name.count("\n") + 1 for name in heat.rows)
    figure, (ax,) = panels(1, 0.28 * columns + 1.0, ROW * lines * rows + 0.3, ())
    ax.pcolormesh(heat.shades, cmap=SHADES, vmin=0, vmax=1, edgecolors="white", linewidth=1.5)
    for row, texts in enumerate(heat.texts):
        for column, text in enumerate(texts):
            if text:
                ax.text(column + 0.5, row + 0.5, text, fontsize="xx-small", ha="center", va="center")
    ax.set(ylim=(rows, 0), xlabel=heat.x)
    ax.set_yticks(np.arange(rows) + 0.5, heat.rows)
    ax.set_xticks(np.arange(columns) + 0.5, heat.columns)
    ax.tick_params(length=0)
    ax.grid(visible=False)
    ax.spines[:].set_visible(False)
    return figure


def _mean_ranks(drawn: MeanRanks) -> Figure:
    figure, (ax,) = panels(1, 3.2, 0.17 * _lines(drawn.methods) * drawn.depth + 0.8, ())
    ax.set(xlim=drawn.ends, ylim=(-drawn.depth, RULER + 0.9))
    ax.xaxis.tick_top()
    ax.spines[:].set_visible(False)
    ax.spines["top"].set(visible=True, position=("data", 0))
    ax.set_yticks([])
    ax.xaxis.set_major_locator(MaxNLocator("auto", integer=True))
    ax.grid(visible=False)
    for bar in drawn.bars:
        ax.plot([bar.low, bar.high], [bar.y, bar.y], color="black", linewidth=2.6, solid_capstyle="butt", clip_on=False)
    for leader in drawn.leaders:
        _named(ax, leader)
    low, high = drawn.ruler
    ax.plot([low, high], [RULER, RULER], color=GREY, linewidth=1.4, marker="|", markersize=5, clip_on=False)
    text = f"critical difference {drawn.difference:.2f}"
    ax.text(low, RULER + 0.3, text, ha="left", va="bottom", color=GREY, fontsize="small")
    return figure


def _named(ax: Axes, of: Leader) -> None:
    """A method's label beside the axis, joined to its mean rank by a line."""
    ax.plot([of.rank, of.rank, of.end], [0, of.y, of.y], color=of.look.color, linewidth=0.9, clip_on=False)
    beside = partial(ax.annotate, textcoords="offset points", va="center", fontsize="small", annotation_clip=False)
    beside(of.text, (of.end, of.y), (-3 if of.left else 3, 0), ha="right" if of.left else "left")


def _lines(looks: Sequence[Look]) -> int:
    """Lines of the tallest label: in a figure for a paper long ones are wrapped."""
    return max((look.label.count("\n") + 1 for look in looks), default=1)


_PAINTERS: dict[type[Drawing], Callable[..., Figure]] = {
    Chart: _chart,
    Spreads: _spreads,
    Heat: _heat,
    MeanRanks: _mean_ranks,
}
