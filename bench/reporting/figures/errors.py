"""Figures of errors as data: their spread, cumulative curves, against time, over iterations.

What has no ground truth is not drawn, and is said not to be.
"""

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from bench.core.problem import Floats
from bench.core.words import counted
from bench.reporting.figures.data import QUANTILES, Axis, Chart, Heat, Panel, Series, Spread, Spreads
from bench.reporting.figures.looks import GREY, Look, Looks
from bench.reporting.tables.printed import degrees
from bench.reporting.tables.rows import Scene, times_note
from bench.reporting.tables.standing import Standing, geometric_mean
from bench.scoring.metrics.oracle import Curve
from bench.scoring.results import Configured, Place

Errors = Mapping[Place, Mapping[Configured, Sequence[Floats]]]
Points = Mapping[Configured, tuple[float, float]]  # seconds and degrees

FLOOR_DEG = 1e-3
FLOOR_S = 1e-4
TITLE_WIDTH = 34  # characters over a panel
SHARES = np.arange(0.0, 101, 2)  # per cent of the cameras at which a cumulative curve has a point
STEPS = 60  # points of a curve over iterations
WORST = 10.0  # times the best median, from which on colours do not change
FRONTIER = Look("Pareto frontier", GREY, "-", "")


@dataclass(frozen=True, eq=False)
class Run:
    """What figures are made of: scored rows, the scenes of a table of them, camera errors, and looks."""

    frame: pd.DataFrame
    scenes: Sequence[Scene]
    errors: Errors
    looks: Looks

    @property
    def known(self) -> list[Scene]:
        """Scenes with a scored camera."""
        return [scene for scene in self.scenes if any(len(pooled(e)) for e in self.of(scene).values())]

    def of(self, scene: Scene) -> Mapping[Configured, Sequence[Floats]]:
        """Camera errors of a scene."""
        return self.errors.get(scene.place, {})

    def title(self, scene: Scene) -> str:
        """Name of a scene in words, with its dataset or protocol where these differ within the run."""
        parts = [scene.dataset] if len({s.dataset for s in self.scenes}) > 1 else []
        parts.append(scene.instance.replace("_", " "))
        if len({s.protocol for s in self.scenes if s.instance == scene.instance}) > 1:
            parts.append(scene.protocol)
        return "\n".join(textwrap.wrap(f"{' / '.join(parts)} ({scene.cameras})", TITLE_WIDTH))

    @property
    def rules(self) -> str:
        """Alignment and protocol, and what is not drawn."""
        alignment, protocol = (
            " and ".join(dict.fromkeys(getattr(s, name) for s in self.scenes)) for name in ("alignment", "protocol")
        )
        known = {scene.place for scene in self.known}
        left = [self.title(scene).replace("\n", " ") for scene in self.scenes if scene.place not in known]
        missing = f" Not drawn, without ground truth or result: {', '.join(left)}." if left else ""
        return f"Alignment: {alignment}; protocol: {protocol}; in brackets after a scene: its cameras.{missing}"


def spreads(run: Run, scenes: Sequence[Scene]) -> Spreads:
    """Spread of the camera errors of each method; how a method ended where it has none."""
    panels = tuple((run.title(scene), tuple(_spread(run, scene, key) for key in run.looks)) for scene in scenes)
    drawn = np.array([[*s.quantiles, s.mean] for _, rows in panels for s in rows if len(s.quantiles)])
    floored = f"Errors below {FLOOR_DEG:g}° are drawn there." if drawn.min() <= FLOOR_DEG else ""
    axis = Axis("error of a camera (°)", _around(drawn, 1.5), log=True)
    return Spreads("Error per scene", floored, run.rules, axis, panels)


def _spread(run: Run, scene: Scene, key: Configured) -> Spread:
    values = np.maximum(pooled(run.of(scene).get(key, ())), FLOOR_DEG)
    if len(values):
        return Spread(run.looks[key], np.percentile(values, QUANTILES), float(values.mean()))
    entry = scene.entry(key)
    ended = next((failed.outcome for failed in entry.failures), "not scored") if entry else "not in this run"
    return Spread(run.looks[key], np.empty(0), math.nan, ended)


def cumulative(run: Run, scenes: Sequence[Scene]) -> Chart:
    """Share of the scored cameras under an angle, a curve a method."""
    curves = [{key: quantiles(run.of(scene).get(key, ())) for key in run.looks} for scene in scenes]
    titles = [run.title(scene) for scene in scenes]
    what = "Share of the scored cameras; further up and left is better."
    return _cumulative(run, titles, curves, what)


def cumulative_overall(run: Run, scenes: Sequence[Scene], standings: Sequence[Standing]) -> Chart:
    """Geometric means over scenes of the same curves, of the methods that ended well on all of them."""
    means = {}
    complete = {s.key for s in standings if s.complete}
    for key in (key for key in run.looks if key in complete):
        of_scenes = [quantiles(run.of(scene).get(key, ())) for scene in scenes]
        if all(map(len, of_scenes)):
            means[key] = np.array([geometric_mean(column) for column in np.array(of_scenes).T])
    what = (
        "At each share of the cameras, the geometric mean over the scenes of the angle under which it lies; further up "
        "and left is better. Only methods that ended well on every scene."
    )
    return _cumulative(run, [""], [means], what)


def _cumulative(run: Run, titles: Sequence[str], curves: Sequence[Mapping[Configured, Floats]], what: str) -> Chart:
    panels = tuple(
        Panel(title, tuple(Series(run.looks[k], np.maximum(x, FLOOR_DEG), SHARES) for k, x in of.items() if len(x)))
        for title, of in zip(titles, curves, strict=True)
    )
    drawn = np.concatenate([np.ones(1), *(s.x for panel in panels for s in panel.series)])
    axis = Axis("angle (°)", (float(np.percentile(drawn, 2)), float(drawn.max())), log=True)
    share = Axis("cameras under it (%)", (0, 101))
    reading = "{y:.3~r} % of cameras under {x:.3~r}°"
    return Chart("Cumulative errors", what, run.rules, axis, share, panels, reading, (2.2, 1.75))


def against_time(run: Run, scenes: Sequence[Scene]) -> Chart:
    """Median error against the time to solve on each scene, with the Pareto frontier."""
    panels = []
    for scene in scenes:
        points = {}
        for entry in scene.entries:
            time, error = entry.values["solve_s"], entry.values["median_deg"]
            if time.known and error.known:
                points[entry.key] = (time.mean, error.mean)
        panels.append((run.title(scene), points))
    return _against_time(run, panels, "", (2.2, 1.9))


def against_time_overall(run: Run, standings: Sequence[Standing]) -> Chart:
    """The same with geometric means over scenes, of the methods that ended well on all of them."""
    complete = [s for s in standings if math.isfinite(s.seconds) and math.isfinite(s.median_deg)]
    points = {s.key: (s.seconds, s.median_deg) for s in complete}
    left = [run.looks[s.key].label for s in standings if s.key not in points]
    remark = f" Did not end well on every scene, so left out: {', '.join(left)}." if left else ""
    remark += f" Geometric means over {counted(max(s.scenes for s in standings), 'scene')}."
    return _against_time(run, [("", points)], remark, (3.4, 2.8))


def _against_time(run: Run, panels: Sequence[tuple[str, Points]], remark: str, size: tuple[float, float]) -> Chart:
    drawn = tuple(Panel(title, _frontier_and_points(run.looks, points)) for title, points in panels)
    times, errors = (np.concatenate([s for p in drawn for s in (getattr(s, axis) for s in p.series)]) for axis in "xy")
    floored = f" Errors below {FLOOR_DEG:g}° count as {FLOOR_DEG:g}°." if errors.min() <= FLOOR_DEG else ""
    what = f"Lower left is better; {times_note(run.frame)}.{remark}{floored}"
    x, y = Axis("time to solve (s)", _decade(times), log=True), Axis("median error (°)", _decade(errors), log=True)
    return Chart("Error against time", what, run.rules, x, y, drawn, "{y:.3~r}° in {x:.3~r} s", size)


def _frontier_and_points(looks: Looks, points: Points) -> tuple[Series, ...]:
    """The methods that no other beats in both time and error, joined by steps; and a point a method."""
    shown = {key: (max(s, FLOOR_S), max(e, FLOOR_DEG)) for key, (s, e) in points.items()}
    best: list[tuple[float, float]] = []
    for time, error in sorted(shown.values()):
        if not best or error < best[-1][1]:
            best.append((time, error))
    frontier = Series(FRONTIER, *_xy(best), kind="steps")
    ordered = sorted(shown.items(), key=lambda item: list(looks).index(item[0]))
    return (
        *(Series(looks[k], *_xy([at]), kind="points", named=at in best) for k, at in ordered),
        frontier,
    )


def _xy(points: Sequence[tuple[float, float]]) -> tuple[Floats, Floats]:
    x, y = np.array(points, dtype=float).reshape(-1, 2).T
    return x, y


def iterations(run: Run, curves: Mapping[Place, Mapping[Configured, Sequence[Curve]]]) -> Chart:
    """Mean error along the checkpoints, a curve a seed; the oracle's pick is a ring."""
    every = [c for by_method in curves.values() for several in by_method.values() for c in several]
    last = max(float(c.iterations.max()) for c in every)
    edge = min(float(c.iterations[c.iterations > 0].min(initial=last)) for c in every) / 2
    panels = tuple(
        Panel(
            run.title(next(scene for scene in run.scenes if scene.place == place)),
            tuple(_along(run.looks[key], c, edge) for key in run.looks for c in by_method.get(key, ())),
        )
        for place, by_method in curves.items()
    )
    errors = np.concatenate([s.y for panel in panels for s in panel.series])
    what = (
        "A curve for each seed of the methods that give checkpoints; iteration 0 is drawn at the left edge. The ring "
        "is the checkpoint with the smallest mean error against ground truth (oracle): no method can choose it."
    )
    x, y = Axis("iteration", (edge, last * 1.1), log=True), Axis("mean error (°)", _around(errors, 1.3), log=True)
    reading = "{y:.3~r}° at iteration {0}, after {1} s"
    return Chart("Error over iterations", what, run.rules, x, y, panels, reading, (2.3, 1.9), "oracle's pick")


def _along(look: Look, curve: Curve, edge: float) -> Series:
    kept = np.unique(np.append(np.linspace(0, len(curve.iterations) - 1, STEPS).astype(int), curve.oracle))
    x, y = np.maximum(curve.iterations[kept], edge), np.maximum(curve.mean_deg[kept], FLOOR_DEG)
    facts = (curve.iterations[kept], curve.seconds[kept])
    return Series(look, x, y, ring=int(np.searchsorted(kept, curve.oracle)), facts=facts)


def by_scene(run: Run, scenes: Sequence[Scene], standings: Sequence[Standing]) -> Heat:
    """Median error of each method on each scene: numbers, on colours for the ratio to the scene's best."""
    medians = np.full((len(standings), len(scenes)), np.nan)
    texts = [["" for _ in scenes] for _ in standings]
    for (row, column), _ in np.ndenumerate(medians):
        entry = scenes[column].entry(standings[row].key)
        if entry is not None:
            value = entry.values["median_deg"]
            medians[row, column] = value.mean
            texts[row][column] = degrees(value.mean) if value.known else ", ".join(entry.outcomes)
    floored = np.maximum(medians, FLOOR_DEG)  # NaN stays
    shades = np.minimum(np.log(floored / np.nanmin(floored, axis=0)) / math.log(WORST), 1)
    return Heat(
        "Error per scene",
        "Median error in degrees, methods in the order of their mean rank. The darker, the further from the best "
        f"median on that scene; the darkest is {WORST:g} times it or more.",
        run.rules,
        tuple(run.looks[s.key].label for s in standings),
        tuple(scene.instance.replace("_", " ") for scene in scenes),
        "scene",
        "median error (°)",
        shades,
        medians,
        tuple(map(tuple, texts)),
    )


def ordered(run: Run, keys: Sequence[Configured]) -> Run:
    """The run with only these methods, in this order."""
    return replace(run, looks={key: run.looks[key] for key in keys})


def quantiles(errors: Sequence[Floats]) -> Floats:
    """Errors at `SHARES` per cent of the scored cameras of all seeds; empty where nothing was scored."""
    values = pooled(errors)
    return np.percentile(values, SHARES) if len(values) else values


def pooled(errors: Sequence[Floats]) -> Floats:
    """Finite errors of all seeds together."""
    values: Floats = np.concatenate([np.empty(0), *errors])
    return values[np.isfinite(values)]


def _around(values: Floats, factor: float) -> tuple[float, float]:
    return float(np.nanmin(values)) / factor, float(np.nanmax(values)) * factor


def _decade(values: Floats) -> tuple[float, float]:
    """A little more than the range of the values, and at least a decade."""
    low, high = float(values.min()), float(values.max())
    return _around(values, max(1.8, math.sqrt(10 * low / high)))
