"""How figures look: one colour, marker and line for each method, and how a figure is saved."""

import math
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from bench.reporting.rows import Configured

# Okabe and Ito's palette, told apart with any colour vision; its yellow is too light for lines on white.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
LINES: tuple[Any, ...] = ("-", (0, (4, 1.5)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p")
GREY = "#666666"
FORMATS = ("png", "pdf", "svg")
SETTINGS: dict[Any, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "text.parse_math": False,  # a title may hold a dollar sign
    "svg.hashsalt": "rotsync-bench",
    "savefig.dpi": 200,
}
LEGEND_LINE = 0.17  # inches


@dataclass(frozen=True)
class Look:
    """How a configured method is called and drawn, the same in every figure of a run."""

    label: str
    color: str
    line: Any
    marker: str


def looks(frame: pd.DataFrame) -> dict[Configured, Look]:
    """A look for each configured method, in the order in which the frame first names them; 28 differ."""
    found = frame.drop_duplicates(["method", "params"])
    heads = [
        f"{title} ({params})" if params else str(title) for title, params in zip(found.title, found.params, strict=True)
    ]
    out = {}
    for k, (method, params, head) in enumerate(zip(found.method, found.params, heads, strict=True)):
        label = head if heads.count(head) == 1 else f"{head} [{method}]"
        turn = k // len(COLORS)
        marker = MARKERS[(k + turn) % len(MARKERS)]
        out[method, params] = Look(label, COLORS[k % len(COLORS)], LINES[turn % len(LINES)], marker)
    return out


@contextmanager
def styled() -> Iterator[None]:
    """Our settings on top of matplotlib's defaults, whatever the user's matplotlibrc says."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(SETTINGS)
        yield


def panels(count: int, width: float, height: float, legend: Sequence[Line2D]) -> tuple[Figure, list[Axes]]:
    """Figure with `count` panels of `width` by `height` inches that share both axes; legend at the right."""
    if count == 1:
        width, height = 1.7 * width, 1.5 * height if legend else height
    columns = min(3, count)
    rows = math.ceil(count / columns)
    tall = rows * height + 0.7
    legend_columns = math.ceil(len(legend) / max(1, int((tall - 0.5) / LEGEND_LINE)))
    longest = max((len(str(handle.get_label())) for handle in legend), default=0)
    wide = columns * width + 0.5 + legend_columns * (0.055 * longest + 0.5) * bool(legend)
    figure = Figure(figsize=(wide, tall), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    axes = list(grid.flat)
    for unused in axes[count:]:
        unused.set_axis_off()
    for ax in axes[max(0, count - columns) : count]:
        ax.xaxis.set_tick_params(labelbottom=True)
    if legend:
        figure.legend(handles=list(legend), loc="outside right upper", ncols=legend_columns)
    return figure, axes[:count]


def describe(figure: Figure, title: str, caption: str) -> None:
    """Title above, caption below."""
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold", fontsize=9)
    lines = textwrap.wrap(caption, int(figure.get_figwidth() * 18))
    figure.supxlabel("\n".join(lines), x=0.01, ha="left", fontsize=7, color=GREY)


def log_axis(axis: Any, low: float, high: float, ticks: Sequence[float]) -> None:
    """Plain numbers at round values of a logarithmic axis."""
    axis.set_major_locator(FixedLocator([t for t in ticks if low <= t <= high]))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def save(figure: Figure, folder: Path, name: str, formats: Sequence[str] = FORMATS) -> list[Path]:
    """Write a figure in each format, fonts embedded, without a date; a missing folder is made."""
    folder.mkdir(parents=True, exist_ok=True)
    dates: dict[str, dict[str, None]] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}
    paths = [folder / f"{name}.{suffix}" for suffix in formats]
    with styled():
        for path, suffix in zip(paths, formats, strict=True):
            figure.savefig(path, format=suffix, metadata=dates.get(suffix, {}))
    return paths
