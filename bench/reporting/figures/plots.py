"""Figures of a scored run: errors per scene, cumulative errors, error against time.

Each takes the frame of scored rows and, for each place and configured method, its per-camera errors in
degrees (one array a seed); none draws what has no ground truth, and says so.
"""

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bench.core.problem import Floats
from bench.reporting.figures.ranking import ranking_figures
from bench.reporting.figures.style import (
    GREY,
    Look,
    columns_of,
    describe,
    lines_of,
    log_axis,
    looks,
    panels,
    save,
    styled,
)
from bench.reporting.tables.rows import OK, Configured, Place, times_note

__all__ = ["cumulative_errors", "error_against_time", "error_per_scene", "figures", "save"]

Errors = Mapping[Place, Mapping[Configured, Sequence[Floats]]]

FLOOR_DEG = 1e-3
FLOOR_S = 1e-4
TITLE_WIDTH = 34  # characters over a panel
ANGLE_TICKS = (0.001, 0.01, 0.1, 1, 10, 100)
CURVE_TICKS = (0.1, 0.3, 1, 3, 10, 30, 100)


def figures(frame: pd.DataFrame, errors: Errors) -> dict[str, Figure]:
    """Every figure that the run has data for, by file name."""
    if not _scored(frame, errors):
        return {}
    drawn = {
        "error-per-scene": error_per_scene(frame, errors),
        "cumulative-errors": cumulative_errors(frame, errors),
        "error-against-time": error_against_time(frame),
    }
    if len(_scored(frame, errors)) > 1:
        drawn["error-against-time-all-scenes"] = error_against_time(frame, aggregated=True)
    return drawn | ranking_figures(frame)


def error_per_scene(frame: pd.DataFrame, errors: Errors) -> Figure:
    """Spread of the per-camera errors, a panel a scene, a line a method; statuses where there is none."""
    places = _scored(frame, errors)
    look = looks(frame)
    with styled():
        figure, axes = panels(len(places), 2.3, 0.19 * lines_of(look) * len(look) + 0.55, ())
        floored = False
        low = math.inf
        for ax, place in zip(axes, places, strict=True):
            ax.set_title(_title(place, frame), loc="left")
            for row, (method, style) in enumerate(look.items()):
                values = _pooled(errors[place].get(method, ()))
                if len(values):
                    floored |= bool((values < FLOOR_DEG).any())
                    low = min(low, _spread(ax, row, np.maximum(values, FLOOR_DEG), style))
                else:
                    status = _status(frame, place, method)
                    ax.text(
                        0.03,
                        row,
                        status,
                        transform=ax.get_yaxis_transform(),
                        va="center",
                        color=GREY,
                        fontsize=7,
                    )
        first = axes[0]
        first.set(xlim=(low / 1.5, 200), xscale="log", ylim=(len(look) - 0.5, -0.5))
        first.set_yticks(range(len(look)), [style.label for style in look.values()])
        for ax in axes:
            log_axis(ax.xaxis, low / 1.5, 200, CURVE_TICKS if low > 0.05 else ANGLE_TICKS)
            ax.grid(visible=False, axis="y")
            ax.tick_params(axis="y", length=0)
        _label_bottom(axes, "error per camera (°)")
        what = "Thick: quartiles; thin: 10th to 90th percentile; dot: median; white diamond: mean."
        describe(figure, "Error per scene", f"{what} {_caption(frame, errors, floored)}")
    return figure


def cumulative_errors(frame: pd.DataFrame, errors: Errors) -> Figure:
    """Share of the scored cameras under an angle, one panel a scene and one curve a method."""
    places = _scored(frame, errors)
    look = looks(frame)
    with styled():
        handles = [Line2D([], [], color=s.color, linestyle=s.line, label=s.label) for s in look.values()]
        figure, axes = panels(len(places), 2.2, 1.75, handles)
        for ax, place in zip(axes, places, strict=True):
            ax.set_title(_title(place, frame), loc="left")
            for method, style in look.items():
                values = np.sort(_pooled(errors[place].get(method, ())))
                if len(values):
                    share = 100 * np.arange(1, len(values) + 1) / len(values)
                    ax.step(
                        np.concatenate([[CURVE_TICKS[0] / 10], np.maximum(values, CURVE_TICKS[0] / 10), [360]]),
                        np.concatenate([[0], share, [100]]),
                        where="post",
                        color=style.color,
                        linestyle=style.line,
                        linewidth=1.2,
                    )
        axes[0].set(xlim=(CURVE_TICKS[0], 180), xscale="log", ylim=(0, 101))
        for ax in axes:
            log_axis(ax.xaxis, CURVE_TICKS[0], 180, CURVE_TICKS)
        _label_bottom(axes, "angle (°)")
        _label_left(axes, "cameras under it (%)")
        what = "Share of the scored cameras; a curve further up and left is better."
        describe(figure, "Cumulative errors", f"{what} {_caption(frame, errors)}")
    return figure


def error_against_time(frame: pd.DataFrame, *, aggregated: bool = False) -> Figure:
    """Median error against the time to solve, with the Pareto frontier.

    Parameters
    ----------
    frame
        Scored rows.
    aggregated
        One panel with geometric means over the scenes with ground truth, of the methods that ended well on
        all of them; otherwise a panel for each scene.
    """
    look = looks(frame)
    by_panel, remarks = _time_panels(frame, look, aggregated)
    drawn = {key for _, rows in by_panel for key in rows.index}
    with styled():
        handles = [
            Line2D([], [], color=s.color, marker=s.marker, linestyle="", label=s.label, markersize=5)
            for key, s in look.items()
            if key in drawn
        ]
        handles.append(Line2D([], [], color=GREY, linewidth=0.8, label="Pareto frontier"))
        size = (3.4, 2.8) if aggregated else (2.2, 1.9)
        figure, axes = panels(len(by_panel), *size, handles)
        for ax, (title, rows) in zip(axes, by_panel, strict=True):
            ax.set_title(title, loc="left")
            _frontier(ax, rows)
            for key, (time, error) in zip(rows.index, rows.to_numpy(), strict=True):
                (point,) = ax.plot(time, error, marker=look[key].marker, color=look[key].color, markersize=5)
                point.set(markeredgewidth=0.3, markeredgecolor="white")
        everything = pd.concat([rows for _, rows in by_panel])
        _log_limits(axes, everything["solve_s"], everything["median_deg"])
        _label_bottom(axes, "time to solve (s)")
        _label_left(axes, "median error (°)")
        floor = f" Errors below {FLOOR_DEG:g}° count as {FLOOR_DEG:g}°."
        floored = floor if (everything["median_deg"] <= FLOOR_DEG).any() else ""
        what = f"Lower left is better; {times_note(frame)}. {_rules(frame)}{remarks}{floored}"
        describe(figure, "Error against time", what)
    return figure


def _time_panels(
    frame: pd.DataFrame, look: Mapping[Configured, Look], aggregated: bool
) -> tuple[list[tuple[str, pd.DataFrame]], str]:
    """Title and (method, params) -> ``solve_s, median_deg`` of each panel; and what is left out."""
    scored = frame[(frame["status"] == OK) & frame["median_deg"].notna() & frame["solve_s"].notna()]
    scored = scored.assign(
        solve_s=pd.to_numeric(scored["solve_s"]).clip(lower=FLOOR_S),
        median_deg=scored["median_deg"].clip(lower=FLOOR_DEG),
    )
    keys = ["dataset", "instance", "protocol", "method", "params"]
    points = scored.groupby(keys, sort=False)[["solve_s", "median_deg"]].mean()
    places: list[Place] = list(dict.fromkeys(key[:3] for key in points.index))
    remarks = _not_drawn(frame, places)
    if not aggregated:
        return [(_title(place, frame), points.loc[place]) for place in places], remarks
    by_method = np.log(points).groupby(["method", "params"], sort=False)
    complete = by_method.size() == len(places)
    rows = np.exp(by_method.mean()[complete])
    incomplete = [look[key].label for key, ended in complete.items() if not ended]
    if incomplete:
        remarks += f" Not on every scene, so left out: {', '.join(incomplete)}."
    return [(f"geometric means over {len(places)} scenes", rows)], remarks


def _spread(ax: Axes, row: int, values: Floats, style: Look) -> float:
    """Draw one method's errors on a line; the smallest value drawn."""
    color = style.color
    p10, p25, p50, p75, p90 = np.percentile(values, [10, 25, 50, 75, 90])
    ax.plot([p10, p90], [row, row], color=color, linewidth=0.9, solid_capstyle="butt")
    ax.plot([p25, p75], [row, row], color=color, linewidth=4, solid_capstyle="butt", alpha=0.55)
    ax.plot(p50, row, marker="o", color=color, markersize=4.5)
    ax.plot(
        values.mean(),
        row,
        marker="D",
        color="white",
        markeredgecolor=color,
        markersize=3.2,
        markeredgewidth=0.8,
    )
    return float(p10)


def _frontier(ax: Axes, rows: pd.DataFrame) -> None:
    """Steps along the methods that no other beats in both time and error."""
    ordered = rows.dropna().sort_values(["solve_s", "median_deg"])
    best = ordered[ordered["median_deg"] < ordered["median_deg"].cummin().shift(fill_value=math.inf)]
    ax.step(best["solve_s"], best["median_deg"], where="post", color=GREY, linewidth=0.8, zorder=1)


def _log_limits(axes: Sequence[Axes], times: pd.Series, errors: pd.Series) -> None:
    x, y = _limits(times), _limits(errors)
    axes[0].set(xlim=x, ylim=y, xscale="log", yscale="log")
    for ax in axes:
        log_axis(ax.xaxis, *x, _ticks(*x))
        log_axis(ax.yaxis, *y, _ticks(*y))


def _limits(values: pd.Series) -> tuple[float, float]:
    """A little more than the range of the values, and at least a decade."""
    low, high = (float(values.min()), float(values.max())) if len(values) else (1.0, 1.0)
    margin = max(1.8, math.sqrt(10 * low / high))
    return low / margin, high * margin


def _ticks(low: float, high: float) -> list[float]:
    """Round values in a range: 1, 2, 5, or only powers of ten where there are many."""
    steps = (1, 2, 5) if high / low < 100 else (1,)
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [step * 10.0**decade for decade in decades for step in steps]


def _scored(frame: pd.DataFrame, errors: Errors) -> list[Place]:
    """Places with a scored camera, in the order of the frame."""
    return [p for p in _places(frame) if any(len(_pooled(e)) for e in errors.get(p, {}).values())]


def _places(frame: pd.DataFrame) -> list[Place]:
    columns = (map(str, frame[name]) for name in ("dataset", "instance", "protocol"))
    return list(dict.fromkeys(zip(*columns, strict=True)))


def _pooled(errors: Iterable[Floats]) -> Floats:
    """Finite errors of all seeds together."""
    values: Floats = np.concatenate([np.empty(0), *errors])
    return values[np.isfinite(values)]


def _at(frame: pd.DataFrame, place: Place) -> pd.DataFrame:
    dataset, instance, protocol = place
    return frame[(frame["dataset"] == dataset) & (frame["instance"] == instance) & (frame["protocol"] == protocol)]


def _status(frame: pd.DataFrame, place: Place, method: Configured) -> str:
    """First word of why a method has no errors on a scene."""
    rows = _at(frame, place)
    statuses = rows.loc[(rows["method"] == method[0]) & (rows["params"] == method[1]), "status"]
    return str(statuses.iloc[0]).split("(")[0] if len(statuses) else "not in this run"


def _title(place: Place, frame: pd.DataFrame) -> str:
    """Name of a scene in words, with its dataset or protocol where these differ within the run."""
    dataset, instance, protocol = place
    parts = [dataset] if frame["dataset"].nunique() > 1 else []
    parts.append(instance.replace("_", " "))
    if len(_at(frame, place)) and frame.loc[frame["instance"] == instance, "protocol"].nunique() > 1:
        parts.append(protocol)
    title = f"{' / '.join(parts)} ({int(_at(frame, place)['n_cameras'].max())})"
    return "\n".join(textwrap.wrap(title, TITLE_WIDTH))


def _rules(frame: pd.DataFrame) -> str:
    alignment, protocol = (" and ".join(dict.fromkeys(map(str, frame[c]))) for c in ("alignment", "protocol"))
    return f"Alignment: {alignment}; protocol: {protocol}; in brackets after a scene: its cameras."


def _caption(frame: pd.DataFrame, errors: Errors, floored: bool = False) -> str:
    floor = f" Errors below {FLOOR_DEG:g}° are drawn there." if floored else ""
    return f"{_rules(frame)}{_not_drawn(frame, _scored(frame, errors))}{floor}"


def _not_drawn(frame: pd.DataFrame, drawn: Sequence[Place]) -> str:
    left = [_title(place, frame).replace("\n", " ") for place in _places(frame) if place not in drawn]
    return f" Not drawn, without ground truth or result: {', '.join(left)}." if left else ""


def _label_bottom(axes: Sequence[Axes], text: str) -> None:
    """Label the x axis of the lowest panel of each column."""
    for ax in axes[-columns_of(len(axes)) :]:
        ax.set_xlabel(text)


def _label_left(axes: Sequence[Axes], text: str) -> None:
    for ax in axes[:: columns_of(len(axes))]:
        ax.set_ylabel(text)
