"""The page that figures are drawn on: fonts, panels, legends, titles, captions; and how a figure is saved."""

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from bench.reporting import appearance
from bench.reporting.figures import plain_font
from bench.reporting.figures.looks import GREY
from bench.reporting.tables.latex import latex_escape

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
MOST_COLUMNS = 3
NARROWEST_PANEL = 2.0  # inches


@contextmanager
def styled() -> Iterator[None]:
    """Our settings on top of matplotlib's defaults, whatever the user's matplotlibrc says."""
    wanted = appearance.current()
    size = {"font.size": wanted.font_size, "axes.titlesize": wanted.font_size, "legend.fontsize": "small"}
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(SETTINGS | size | _font(wanted.font))
        yield


def _font(wanted: str) -> dict[str, Any]:
    return {"font.family": wanted} if wanted else {"font.sans-serif": [plain_font.family(), plain_font.OF]}


def columns_of(count: int) -> int:
    """Panels beside each other, of `count`: in as few rows as there must be, all as full as can be."""
    width = appearance.current().width_in
    most = min(MOST_COLUMNS, count, max(1, int(width / NARROWEST_PANEL)) if width else count)
    return math.ceil(count / math.ceil(count / most))


def panels(count: int, width: float, height: float, legend: Sequence[Line2D]) -> tuple[Figure, list[Axes]]:
    """Figure with `count` panels that share both axes.

    The panels are `width` by `height` inches with the legend at their right; where a style file gives the width of the
    figure, as wide as that leaves them, with the legend below.
    """
    fixed = appearance.current().width_in
    if count == 1 and not fixed:
        width, height = 1.7 * width, 1.5 * height if legend else height
    columns = columns_of(count)
    rows = math.ceil(count / columns)
    tall = rows * height + 0.7
    labels = [str(handle.get_label()) for handle in legend]
    longest = 0.055 * max((len(line) for label in labels for line in label.split("\n")), default=0) + 0.5
    lines = max((label.count("\n") + 1 for label in labels), default=1)
    if fixed:
        legend_columns = max(1, int(fixed / longest))
        wide, tall = fixed, tall - 0.5 + lines * LEGEND_LINE * math.ceil(len(legend) / legend_columns)
    else:
        legend_columns = math.ceil(len(legend) / max(1, int((tall - 0.5) / LEGEND_LINE)))
        wide = columns * width + 0.5 + legend_columns * longest * bool(legend)
    figure = Figure(figsize=(wide, tall), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    axes = list(grid.flat)
    for unused in axes[count:]:
        unused.set_axis_off()
    for ax in axes[max(0, count - columns) : count]:
        ax.xaxis.set_tick_params(labelbottom=True)
    if legend:
        below = "outside lower center" if fixed else "outside right upper"
        figure.legend(handles=list(legend), loc=below, ncols=legend_columns)  # type: ignore[call-overload]
    return figure, axes[:count]


def describe(figure: Figure, title: str, caption: str) -> None:
    """Title above, caption below; in a figure for a paper, which has its own, they are kept but not drawn."""
    drawn = appearance.current().width_in is None
    lines = textwrap.wrap(caption.replace(" %", "\u00a0%"), int(figure.get_figwidth() * 18))
    for artist in (
        figure.suptitle(title, x=0.01, ha="left", fontweight="bold", fontsize="large"),
        figure.supxlabel("\n".join(lines), x=0.01, ha="left", fontsize="small", color=GREY),
    ):
        artist.set_visible(drawn)
        artist.set_in_layout(drawn)


def described(figure: Figure) -> tuple[str, str]:
    """Title and caption of a figure."""
    return figure.get_suptitle(), " ".join(figure.get_supxlabel().split())


def captions(figures: Mapping[str, Figure]) -> str:
    r"""LaTeX ``figure`` environments, by file name; the document needs ``\usepackage{graphicx}``."""
    blocks = ["% needs \\usepackage{graphicx}"]
    for name, figure in figures.items():
        title, caption = described(figure)
        star = "*" if figure.get_figwidth() > 4 else ""
        blocks.append(
            f"\\begin{{figure{star}}}[htbp]\n\\centering\n\\includegraphics{{{name}.pdf}}\n"
            f"\\caption{{{latex_escape(title)}. {latex_escape(caption)}}}\n\\end{{figure{star}}}"
        )
    return "\n\n".join(blocks) + "\n"


def log_axis(axis: Any, low: float, high: float, ticks: Sequence[float]) -> None:
    """Plain numbers at round values of a logarithmic axis."""
    axis.set_major_locator(FixedLocator([t for t in ticks if low <= t <= high]))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def save(figure: Figure, folder: Path, name: str, formats: Sequence[str] = FORMATS) -> list[Path]:
    """Write a figure in each format, laid out once, fonts embedded, without a date; a missing folder is made."""
    folder.mkdir(parents=True, exist_ok=True)
    title, caption = described(figure)
    metadata: dict[str, dict[str, str | None]] = {
        "pdf": {"CreationDate": None, "Title": title, "Subject": caption},
        "svg": {"Date": None},
    }
    paths = [folder / f"{name}.{suffix}" for suffix in formats]
    with styled():
        figure.draw_without_rendering()
        figure.set_layout_engine(None)  # else each format lays it out again
        for path, suffix in zip(paths, formats, strict=True):
            figure.savefig(path, format=suffix, metadata=metadata.get(suffix, {}))
    return paths
