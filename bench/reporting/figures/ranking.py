"""Figures of a run over several problems: who comes first, and how sure that is.

What they show as plain data: `bench.scoring.inference.ranking.rank_frame` and `critical_difference`, and
`bench.scoring.inference.profiles.profile_frame`.
"""

import math

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from bench.reporting.figures.style import GREY, Look, describe, lines_of, log_axis, looks, panels, styled
from bench.reporting.tables.rows import Configured, times_note
from bench.scoring.inference.blocks import Blocks, blocks
from bench.scoring.inference.profiles import performance_profiles
from bench.scoring.inference.ranking import critical_difference, rank_frame

FLOOR_DEG = 1e-3
FLOOR_S = 1e-4
LABELLED = 0.005  # a probability below it is not written into its cell
WIDEST_RATIO = 1000.0
ROW = 0.17  # inches
TICKS = [step * 10.0**k for k in range(4) for step in (1, 2, 5)]


def ranking_figures(frame: pd.DataFrame) -> dict[str, Figure]:
    """Rank probabilities, critical differences and performance profiles, where there are two problems or more."""
    of_error = blocks(frame, "median_deg", FLOOR_DEG)
    if not of_error.enough:
        return {}
    figures = {
        "rank-probabilities": rank_probabilities(frame, of_error),
        "critical-difference": critical_differences(frame, of_error),
        "performance-profile-error": profile(frame, of_error, "median error"),
    }
    of_time = blocks(frame, "solve_s", FLOOR_S)
    if of_time.enough:
        figures["performance-profile-time"] = profile(frame, of_time, "time")
    return figures


def rank_probabilities(frame: pd.DataFrame, table: Blocks) -> Figure:
    """Heat strip: a row for each method, a column for each rank, the probability as shade and as per cent."""
    found = rank_frame(table)
    look = looks(frame)
    shares = found.filter(like="p_rank_").to_numpy()
    count = len(found)
    with styled():
        figure, (ax,) = panels(1, 0.28 * count + 1.0, ROW * lines_of(look) * count + 0.3, ())
        ax.pcolormesh(shares, cmap="Blues", vmin=0, vmax=1, edgecolors="white", linewidth=1.5)
        for (row, column), share in np.ndenumerate(shares):
            if share >= LABELLED:
                color = "white" if share > 0.55 else "black"
                text = ax.text(column + 0.5, row + 0.5, f"{100 * share:.0f}", color=color, fontsize="xx-small")
                text.set(ha="center", va="center")
        ax.set(ylim=(count, 0), xlabel="rank")
        ax.set_yticks(
            np.arange(count) + 0.5, [look[m, p].label for m, p in zip(found.method, found.params, strict=True)]
        )
        ax.set_xticks(np.arange(count) + 0.5, [str(place) for place in range(1, count + 1)])
        ax.tick_params(length=0)
        ax.grid(visible=False)
        ax.spines[:].set_visible(False)
        what = "Probability in per cent that a method takes each rank by median error"
        how = "bootstrap over problems of its mean rank"
        describe(figure, "Rank probabilities", f"{what}: {how}. {_problems(frame, table, look)}")
    return figure


def critical_differences(frame: pd.DataFrame, table: Blocks) -> Figure:
    """Methods on an axis of mean ranks; bars join those that Nemenyi's test does not tell apart."""
    found = critical_difference(table)
    look = looks(frame)
    count = len(found.methods)
    half = math.ceil(count / 2)
    lanes = len(found.groups)
    with styled():
        figure, (ax,) = panels(1, 3.2, ROW * lines_of(look) * (half + 0.6 * lanes) + 0.7, ())
        best, worst = 1.0, float(count)
        ax.set(xlim=(best, worst), ylim=(-(half + 0.6 * lanes + 1.2), 1.6))
        ax.xaxis.tick_top()
        ax.spines[:].set_visible(False)
        ax.spines["top"].set(visible=True, position=("data", 0))
        ax.set_yticks([])
        ax.xaxis.set_major_locator(MaxNLocator("auto", integer=True))
        ax.grid(visible=False)
        for lane, (first, last) in enumerate(found.groups):
            y = -0.55 - 0.6 * lane
            ends = found.mean_ranks[[first, last]] + np.array([-0.06, 0.06])
            ax.plot(ends, [y, y], color="black", linewidth=2.6, solid_capstyle="butt")
        for position, (method, rank) in enumerate(zip(found.methods, found.mean_ranks, strict=True)):
            left = position < half
            level = position if left else count - 1 - position
            _named(ax, look[method], float(rank), -(level + 1.0 + 0.6 * lanes), left, (best, worst))
        shown = min(found.critical_difference, worst - best)
        ax.plot([best, best + shown], [1.2, 1.2], color=GREY, linewidth=1.4, marker="|", markersize=5, clip_on=False)
        text = f"critical difference {found.critical_difference:.2f}"
        ax.text(best, 1.35, text, ha="left", va="bottom", color=GREY, fontsize="small")
        p = "< 0.001" if found.friedman_p < 0.001 else f"= {found.friedman_p:.3f}"
        what = (
            f"Mean ranks by median error, 1 the best; bars join methods that are not told apart (Nemenyi's test, level "
            f"5 %, after Friedman's, p {p})."
        )
        describe(figure, "Critical difference", f"{what} {_problems(frame, table, look)}")
    return figure


def _named(ax: Axes, look: Look, rank: float, y: float, left: bool, ends: tuple[float, float]) -> None:
    """A method's label beside the axis, joined to its mean rank by a line."""
    end = ends[0] if left else ends[1]
    ax.plot([rank, rank, end], [0, y, y], color=look.color, linewidth=0.9, clip_on=False)
    offset = (-3, 0) if left else (3, 0)
    ax.annotate(
        f"{look.label}  {rank:.2f}",
        (end, y),
        offset,
        textcoords="offset points",
        ha="right" if left else "left",
        va="center",
        fontsize="small",
        annotation_clip=False,
    )


def profile(frame: pd.DataFrame, table: Blocks, what: str) -> Figure:
    """Share of the problems on which a method is within a factor of the best, for each factor."""
    found = performance_profiles(table)
    look = looks(frame)
    steps = np.concatenate([p.ratios for p in found])
    right = min(max(float(steps.max()) * 1.2, 2.0), WIDEST_RATIO)
    with styled():
        handles = [_line(look[p.method], [], []) for p in found]
        figure, (ax,) = panels(1, 2.4, 1.9, handles)
        for p in found:
            line = _line(look[p.method], np.append(p.ratios, WIDEST_RATIO), np.append(p.shares, p.shares[-1]))
            ax.add_line(line)
        ax.set(xlim=(1, right), xscale="log", ylim=(0, 1.02))
        log_axis(ax.xaxis, 1, right, TICKS)
        ax.set_xlabel(f"{what}, times that of the best method")
        ax.set_ylabel("share of the problems")
        times = f" {times_note(frame).capitalize()}." if what == "time" else ""
        text = "Further up is better; at the left edge: the share on which a method is the best."
        describe(figure, f"Performance profile of the {what}", f"{text}{times} {_problems(frame, table, look)}")
    return figure


def _line(look: Look, x: object, y: object) -> Line2D:
    style = {"color": look.color, "linestyle": look.line, "linewidth": 1.2, "label": look.label}
    return Line2D(x, y, drawstyle="steps-post", **style)  # type: ignore[arg-type]


def _problems(frame: pd.DataFrame, table: Blocks, look: dict[Configured, Look]) -> str:
    """How many problems there are, what is left out, and the rules."""
    scenes = len(set(table.scenes))
    drawn = len(table.values)
    of = f"{drawn} scenes" if scenes == drawn else f"{drawn} problems ({scenes} {'scene' if scenes == 1 else 'scenes'})"
    out = [look[method].label for method in table.left_out]
    left = f" Not run on all of them, so left out: {', '.join(out)}." if out else ""
    rule = " and ".join(dict.fromkeys(map(str, frame["alignment"])))
    return f"Over {of} with ground truth; a method that failed ranks last there.{left} Alignment: {rule}."
