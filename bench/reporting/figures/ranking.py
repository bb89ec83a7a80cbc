"""Figures of a run over several problems as data: who comes first, and how sure that is."""

import numpy as np
import pandas as pd

from bench.core.words import counted
from bench.reporting.figures.data import Axis, Chart, Drawing, Heat, MeanRanks, Panel, Series
from bench.reporting.figures.errors import FLOOR_DEG, FLOOR_S
from bench.reporting.figures.looks import Looks
from bench.reporting.tables.rows import times_note
from bench.scoring.inference.blocks import Blocks, blocks
from bench.scoring.inference.profiles import performance_profiles
from bench.scoring.inference.ranking import critical_difference, mean_ranks, rank_probabilities

LABELLED = 0.005  # a probability below it is not written into its cell
WIDEST_RATIO = 1000.0


def rankings(frame: pd.DataFrame, looks: Looks) -> dict[str, Drawing]:
    """Rank probabilities, critical differences and performance profiles, where there are two problems or more."""
    table = blocks(frame)
    if not table.enough:
        return {}
    found = {
        "rank-probabilities": probabilities(frame, table, looks),
        "critical-difference": differences(frame, table, looks),
        "performance-profile-error": profile(frame, blocks(frame, "median_deg", FLOOR_DEG), looks, "median error"),
    }
    of_time = blocks(frame, "solve_s", FLOOR_S)
    if of_time.enough:
        found["performance-profile-time"] = profile(frame, of_time, looks, "time")
    return found


def probabilities(frame: pd.DataFrame, table: Blocks, looks: Looks) -> Heat:
    """A row for each method, a column for each rank, the probability as shade and in per cent."""
    order = np.argsort(mean_ranks(table), kind="stable")
    shares = rank_probabilities(table)[order]
    return Heat(
        "Rank probabilities",
        "Probability in per cent that a method takes each rank by median error: bootstrap over problems of its mean "
        "rank.",
        _problems(frame, table, looks),
        tuple(looks[table.methods[k]].label for k in order),
        tuple(str(place) for place in range(1, len(order) + 1)),
        "rank",
        "probability (%)",
        shares,
        100 * shares,
        tuple(tuple(f"{100 * p:.0f}" if p >= LABELLED else "" for p in row) for row in shares.tolist()),
    )


def differences(frame: pd.DataFrame, table: Blocks, looks: Looks) -> MeanRanks:
    """Methods by mean rank, and which of them Nemenyi's test does not tell apart."""
    found = critical_difference(table)
    p = "< 0.001" if found.friedman_p < 0.001 else f"= {found.friedman_p:.3f}"
    return MeanRanks(
        "Critical difference",
        "Mean ranks by median error, 1 the best; bars join methods that are not told apart: Nemenyi's test, level 5 % "
        f"after Friedman's (p {p}), by which mean ranks differ from {found.critical_difference:.2f} on.",
        _problems(frame, table, looks),
        tuple(looks[method] for method in found.methods),
        found.mean_ranks,
        found.groups,
        found.critical_difference,
    )


def profile(frame: pd.DataFrame, table: Blocks, looks: Looks, what: str) -> Chart:
    """Share of the problems on which a method is within a factor of the best, for each factor."""
    found = performance_profiles(table)
    right = min(max(max(float(p.ratios[-1]) for p in found) * 1.2, 2.0), WIDEST_RATIO)
    series = []
    for p in sorted(found, key=lambda p: list(looks).index(p.method)):
        drawn = p.ratios <= right
        x, y = np.append(p.ratios[drawn], right), 100 * np.append(p.shares[drawn], p.shares[drawn][-1])
        series.append(Series(looks[p.method], x, y, kind="steps"))
    times = f" {times_note(frame).capitalize()}." if what == "time" else ""
    return Chart(
        f"Performance profile of the {what}",
        "On which share of the problems a method is within a factor of the best one there (Dolan and Moré 2002). "
        f"Further up is better; at the left edge: the share on which a method is the best.{times}",
        _problems(frame, table, looks),
        Axis(f"{what}, times that of the best method", (1.0, right), log=True),
        Axis("problems (%)", (0, 102)),
        (Panel("", tuple(series)),),
        "{y:.3~r} % of the problems within {x:.3~r} times the best",
        (2.4, 1.9),
    )


def _problems(frame: pd.DataFrame, table: Blocks, looks: Looks) -> str:
    """How many problems there are, what is left out, and the rules."""
    scenes = len(set(table.scenes))
    drawn = len(table.values)
    of = counted(scenes, "scene") if scenes == drawn else f"{drawn} problems ({counted(scenes, 'scene')})"
    out = [looks[method].label for method in table.left_out]
    left = f" Not run on all of them, so left out: {', '.join(out)}." if out else ""
    rule = " and ".join(dict.fromkeys(map(str, frame["alignment"])))
    return f"Over {of} with ground truth; a method that failed ranks last there.{left} Alignment: {rule}."
