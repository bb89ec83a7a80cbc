"""The sections on who comes first over several problems, and how sure that is."""

import pandas as pd

from bench.reporting.html import figures
from bench.reporting.html.section import Section
from bench.scoring.inference.blocks import Blocks, blocks
from bench.scoring.inference.profiles import performance_profiles
from bench.scoring.inference.ranking import CriticalDifference, critical_difference, rank_frame

FLOOR_DEG = 1e-3
WIDEST = 1000.0  # ratio to the best up to which a profile is drawn


def sections(frame: pd.DataFrame) -> list[Section]:
    """Rank probabilities, critical difference and performance profiles; none with fewer than two problems."""
    table = blocks(frame, "median_deg", FLOOR_DEG)
    if not table.enough:
        return []
    look = figures.looks_by_selection(frame)
    return [_probabilities(table, look), _critical_difference(table, look), _profiles(table, look)]


def _probabilities(table: Blocks, look: figures.Looks) -> Section:
    found = rank_frame(table)
    labels = [look[key].label for key in zip(found["method"], found["params"], strict=True)]
    shares = 100 * found.filter(like="p_rank_").to_numpy()
    heat = {
        "type": "heatmap",
        "name": "probability in %",
        "x": [str(place) for place in range(1, len(labels) + 1)],
        "y": labels,
        "z": shares.round(1).tolist(),
        "zmin": 0,
        "zmax": 100,
        "colorscale": [[0, "#f7fbff"], [0.5, "#6baed6"], [1, "#08306b"]],
        "xgap": 1,
        "ygap": 1,
        "colorbar": {"title": {"text": "%"}},
    }
    layout = {
        "xaxis": {"title": {"text": "rank"}, "type": "category"},
        "yaxis": {"title": {"text": "method"}, "autorange": "reversed", "automargin": True},
        "height": 120 + 26 * len(labels),
    }
    said = "How probable it is, in per cent, that a method takes each rank by median error: a bootstrap over problems."
    return Section("rank-probabilities", "Rank probabilities", (said,), {"data": [heat], "layout": layout})


def _critical_difference(table: Blocks, look: figures.Looks) -> Section:
    found = critical_difference(table)
    labels = [look[method].label for method in found.methods]
    ranks = found.mean_ranks.round(3).tolist()
    marks = {"type": "scatter", "mode": "markers", "name": "mean rank", "x": ranks, "y": labels}
    bars = [
        {
            "type": "scatter",
            "mode": "lines",
            "name": "not told apart",
            "x": [ranks[first]] * (last - first + 1),
            "y": labels[first : last + 1],
            "line": {"width": 4, "color": figures.GREY},
            "opacity": 0.6,
            "showlegend": k == 0,
        }
        for k, (first, last) in enumerate(found.groups)
    ]
    layout = {
        "xaxis": {"title": {"text": "mean rank"}},
        "yaxis": {"title": {"text": "method"}, "autorange": "reversed", "automargin": True, "type": "category"},
        "height": 140 + 24 * len(labels),
    }
    return Section(
        "critical-difference", "Critical difference", _words(found), {"data": [marks, *bars], "layout": layout}
    )


def _words(found: CriticalDifference) -> tuple[str, ...]:
    p = "below 0.001" if found.friedman_p < 0.001 else f"{found.friedman_p:.3f}"
    return (
        f"Mean ranks by median error over {found.problems} problems. Friedman's test: p {p}. By Nemenyi's, methods "
        f"whose mean ranks differ by less than {found.critical_difference:.2f} are not told apart; bars join them.",
    )


def _profiles(table: Blocks, look: figures.Looks) -> Section:
    profiles = performance_profiles(table)
    end = min(WIDEST, 1.3 * max(float(profile.ratios[-1]) for profile in profiles))
    traces = []
    for profile in profiles:
        own = look[profile.method]
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": own.label,
                "x": [*profile.ratios.clip(max=end).round(4).tolist(), round(end, 4)],
                "y": [*(100 * profile.shares).round(1).tolist(), round(100 * float(profile.shares[-1]), 1)],
                "line": {"shape": "hv", "color": own.color, "dash": figures.dash(own)},
            }
        )
    layout = {
        "xaxis": {"title": {"text": "times the best median error"}, **figures.LOG_AXIS},
        "yaxis": {"title": {"text": "problems in %"}, "range": [0, 102]},
        "height": 460,
    }
    said = (
        "On which share of the problems a method is within a factor of the best one there (Dolan and Moré 2002). "
        "Left end: how often it is the best; right end: how often it ended well."
    )
    return Section("performance-profile", "Performance profiles", (said,), {"data": traces, "layout": layout})
