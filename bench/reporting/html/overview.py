"""The sections on all scenes together, and those of one scene that need nothing but its scores."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from bench.core.problem import Floats
from bench.reporting.html import figures, words
from bench.reporting.html.section import Section, Table, anchor
from bench.reporting.html.standing import Standing
from bench.reporting.tables.rows import Scene, times_note
from bench.scoring.results import Configured, Place, Results
from bench.storage.store import Store

SHOWN = 8  # curves that are visible at first
MIDDLE = len(figures.SHARES) // 2  # where a cumulative curve has the median


def overall(results: Results, scenes: Sequence[Scene], standings: Sequence[Standing]) -> list[Section]:
    """Error against time, error per scene and cumulative errors over all scenes that were scored."""
    known = [scene for scene in scenes if any(entry.scored for entry in scene.entries)]
    if len(known) < 2:
        return []
    look = figures.looks_by_selection(results.frame)
    return [
        _time_section(results.frame, known, standings, look),
        _scene_section(known, standings),
        _cumulative_section(results, known, standings, look),
    ]


def scene_sections(store: Store, results: Results, place: Place) -> list[Section]:
    """Error against time, spread, cumulative errors and error over iterations on one scene."""
    errors = results.errors.get(place, {})
    frame = results.frame
    rows = frame[(frame["dataset"] == place[0]) & (frame["instance"] == place[1]) & (frame["protocol"] == place[2])]
    quantiles = {key: q for key, e in errors.items() if (q := figures.quantiles_of(e)) is not None}
    if not quantiles:
        return []
    quantiles = {key: quantiles[key] for key in sorted(quantiles, key=lambda key: float(quantiles[key][MIDDLE]))}
    every = figures.looks_by_selection(frame)
    look = {key: every[key] for key in quantiles}
    name = "-".join(place)
    found = [
        Section(
            anchor("time", name),
            "Error against time",
            (f"Lower left is better; {times_note(rows)}.",),
            figures.against_time(_points(rows, look), look),
        ),
        Section(
            anchor("spread", name),
            "Errors of the cameras",
            ("Box: quartiles and median; whiskers: 10th and 90th percentile; dashes: the mean.",),
            figures.spread(errors, look),
        ),
        Section(
            anchor("cumulative", name),
            "Cumulative errors",
            (f"Further up and left is better.{_switch_on(len(quantiles))}",),
            figures.cumulative(quantiles, look, list(quantiles)[:SHOWN]),
        ),
    ]
    curves = results.curves.get(place, {})
    if curves:
        found.append(
            Section(
                anchor("iterations", name),
                "Error over iterations",
                ("Methods that give checkpoints; a curve for each seed.",),
                figures.over_iterations(curves, every),
            )
        )
    return found


def dependence(by_rule: Mapping[str, Sequence[Scene]]) -> Table:
    """Who is among the best on each scene under each alignment rule."""
    rows = []
    for k, scene in enumerate(next(iter(by_rule.values()))):
        best = [", ".join(e.label for e in scenes[k].entries if e.best) or None for scenes in by_rule.values()]
        if any(best):
            rows.append((words.spoken(scene), *best))
    return Table("Best median, and what cannot be told apart from it, by alignment", ("Scene", *by_rule), tuple(rows))


def _time_section(
    frame: pd.DataFrame, known: Sequence[Scene], standings: Sequence[Standing], look: figures.Looks
) -> Section:
    points = {
        (s.method, s.params): (s.seconds, s.median_deg)
        for s in standings
        if math.isfinite(s.seconds) and math.isfinite(s.median_deg)
    }
    left = [s.label for s in standings if (s.method, s.params) not in points]
    words = [f"Geometric means over {len(known)} scenes; lower left is better; {times_note(frame)}."]
    if left:
        words.append(f"Left out, because they did not end well on every scene: {', '.join(left)}.")
    return Section("time", "Error against time", tuple(words), figures.against_time(points, look))


def _scene_section(known: Sequence[Scene], standings: Sequence[Standing]) -> Section:
    of = [{(e.method, e.params): e for e in scene.entries} for scene in known]
    medians = np.full((len(standings), len(known)), np.nan)
    statuses = [["" for _ in known] for _ in standings]
    for row, standing in enumerate(standings):
        for column, entries in enumerate(of):
            entry = entries.get((standing.method, standing.params))
            if entry is not None:
                medians[row, column] = entry.values["median_deg"].mean
                statuses[row][column] = entry.failure.split("(")[0]
    names = [words.spoken(scene) for scene in known]
    return Section(
        "error-per-scene",
        "Error per scene",
        (
            "Median error in degrees, methods in the order of their mean rank. The darker, the further from the best "
            f"median on that scene; the darkest is {figures.WORST:g} times it or more.",
        ),
        figures.by_scene(names, [s.label for s in standings], medians, statuses),
    )


def _cumulative_section(
    results: Results, known: Sequence[Scene], standings: Sequence[Standing], look: figures.Looks
) -> Section:
    quantiles: dict[Configured, Floats] = {}
    for standing in standings:
        key = (standing.method, standing.params)
        errors = [results.errors[s.dataset, s.instance, s.protocol].get(key, ()) for s in known]
        of_scenes = [q for e in errors if (q := figures.quantiles_of(e)) is not None]
        if standing.complete and len(of_scenes) == len(known):
            quantiles[key] = figures.mean_quantiles(of_scenes)
    words = (
        "At each share of the cameras, the geometric mean over the scenes of the angle under which it lies; further up "
        f"and left is better. Only methods that ended well on every scene.{_switch_on(len(quantiles))}"
    )
    return Section(
        "cumulative", "Cumulative errors", (words,), figures.cumulative(quantiles, look, list(quantiles)[:SHOWN])
    )


def _switch_on(curves: int) -> str:
    return f" The best {SHOWN} of {curves} are shown; the legend switches the others on." if curves > SHOWN else ""


def _points(rows: pd.DataFrame, look: figures.Looks) -> dict[Configured, tuple[float, float]]:
    ok = rows[(rows["status"] == "ok") & rows["median_deg"].notna() & rows["solve_s"].notna()]
    means = ok.assign(solve_s=pd.to_numeric(ok["solve_s"])).groupby(["method", "params"], sort=False)
    found = means[["solve_s", "median_deg"]].mean()
    return {key: (float(found["solve_s"][key]), float(found["median_deg"][key])) for key in look if key in found.index}
