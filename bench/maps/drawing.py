"""A phase map drawn: a panel for each method, and one with every boundary and the lines of theory."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator

from bench.core.problem import Floats
from bench.maps.adaptive import boundary
from bench.maps.axes import Axis
from bench.maps.bounds import Limits
from bench.maps.criterion import Criterion
from bench.maps.sweep import Layers
from bench.reporting.figures.looks import LINES, look_of
from bench.reporting.figures.style import describe, panels, styled

OUTCOMES = LinearSegmentedColormap.from_list("outcomes", ["#f0b489", "#f7f7f7", "#8fbfe0"])
FAINT = 0.35  # how strongly a cell shows that has no sample of its own
DOT = 3.0  # points squared, for each sample
TICKS = 6
WIDEST, THINNEST = 4.0, 1.0  # points; boundaries that coincide show as nested lines
INK = "#222222"


def draw(
    layers: Mapping[str, Layers],
    axes: tuple[Axis, Axis],
    success: Criterion,
    limits: Limits | None,
    title: str,
    caption: str,
) -> Figure:
    """Draw a map.

    Parameters
    ----------
    layers, axes
        What is known of each method, and the horizontal and vertical axis.
    success, limits
        What counts as success, and what theory says, where it does.
    title, caption
        What stands above and below.
    """
    lines = _lines(limits, success) if limits is not None else []
    looks = {m: look_of(m) for m in layers}
    with styled():
        handles = [Line2D([], [], color=look.color, linestyle=look.line, label=m) for m, look in looks.items()]
        handles += [Line2D([], [], color=INK, linewidth=1, linestyle=line, label=label) for label, line, _, _ in lines]
        figure, drawn = panels(len(layers) + 1, 2.3, 2.2, handles)
        widths = np.linspace(WIDEST, THINNEST, len(layers))
        together = drawn[-1]
        together.set_title("every boundary", loc="left")
        for ax, (method, own), width in zip(drawn, layers.items(), widths, strict=False):
            ax.set_title(method, loc="left")
            _cells(ax, own)
            ends = list(boundary(own.success))
            ax.add_collection(LineCollection(ends, colors=INK, linewidths=1.6))
            together.add_collection(
                LineCollection(
                    ends, colors=looks[method].color, linestyles=[looks[method].line], linewidths=float(width)
                )
            )
        for ax in drawn:
            for _, line, values, level in lines:
                ax.contour(values.T, levels=[level], colors=INK, linewidths=1, linestyles=[line])
        for ax in drawn[-3:]:
            ax.set_xlabel(axes[0].parameter)
        for ax in drawn[::3]:
            ax.set_ylabel(axes[1].parameter)
        _scale(drawn[0], axes)
        describe(figure, title, caption)
    return figure


def _lines(limits: Limits, success: Criterion) -> list[tuple[str, Any, Floats, float]]:
    """Label, dashes, field and level of each line of theory that crosses the map."""
    candidates: list[tuple[str, Any, Floats | None, float]] = [
        ("inliers connect half of the graphs", LINES[1], limits.connected, 0.5),
        ("eigenvectors detect (n to infinity)", LINES[2], limits.detection, 1.0),
    ]
    if not success.relative:
        label = f"clairvoyant efficient: {success.value:g}° (Cramér-Rao)"
        candidates.append((label, LINES[3], limits.clairvoyant_deg, success.value))
    return [
        (label, dashes, values, level)
        for label, dashes, values, level in candidates
        if values is not None and np.isfinite(values).any() and np.nanmin(values) < level < np.nanmax(values)
    ]


def _cells(ax: Axes, own: Layers) -> None:
    """Colours by the share of successes, faint where it is only expected; a dot for each sampled cell."""
    samples = own.samples
    share = np.where(samples > 0, own.successes / np.maximum(samples, 1), own.success)
    ax.imshow(
        share.T, origin="lower", aspect="auto", cmap=OUTCOMES, vmin=0, vmax=1, alpha=np.where(samples > 0, 1, FAINT).T
    )
    x, y = np.nonzero(samples)
    ax.scatter(x, y, s=DOT * samples[x, y], color=INK, alpha=0.5, linewidths=0)
    ax.grid(visible=False)


def _scale(ax: Axes, axes: tuple[Axis, Axis]) -> None:
    ax.set(xlim=(-0.5, len(axes[0].values) - 0.5), ylim=(-0.5, len(axes[1].values) - 0.5))
    for side, axis in zip((ax.xaxis, ax.yaxis), axes, strict=True):
        places = _ticks(len(axis.values))
        side.set_major_locator(FixedLocator(places))
        side.set_ticklabels([f"{axis.values[k]:.3g}" for k in places])


def _ticks(count: int) -> Sequence[int]:
    return range(0, count, -(-count // TICKS))


def summary(layers: Mapping[str, Layers], most: int) -> Iterable[str]:
    """A line for each method: how much of the map it solves, and what finding that out took.

    Parameters
    ----------
    layers
        What is known of each method.
    most
        Samples of a cell in the full grid.
    """
    width = max(map(len, layers))
    for method, own in layers.items():
        taken, grid = own.samples.sum(), most * own.samples.size
        failed = f", {own.failed.sum()} without an answer" if own.failed.any() else ""
        yield (
            f"{method:<{width}}  succeeds in {own.success.mean():4.0%} of the cells; "
            f"{taken} solves of {grid} ({taken / grid:.0%}){failed}"
        )
