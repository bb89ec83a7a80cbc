"""The sections on all scenes together, and those of one scene that need nothing but its scores."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from bench.reporting.figures import errors
from bench.reporting.figures.data import Chart, Drawing, Spreads
from bench.reporting.figures.looks import looks_by_selection
from bench.reporting.figures.paint_plotly import SPREAD, paint
from bench.reporting.figures.ranking import rankings
from bench.reporting.html import words
from bench.reporting.html.section import Section, Table, anchor
from bench.reporting.tables.rows import Scene
from bench.reporting.tables.standing import Standing
from bench.scoring.metrics.oracle import Curve
from bench.scoring.results import Configured, Place, Results

SHOWN = 8  # curves that are visible at first
MIDDLE = len(errors.SHARES) // 2  # where a cumulative curve has the median


def overall(results: Results, scenes: Sequence[Scene], standings: Sequence[Standing]) -> list[Section]:
    """Error against time, error per scene, cumulative errors and ranks over all scenes that were scored."""
    looks = looks_by_selection(results.frame)
    run = errors.Run(results.frame, scenes, results.errors, looks)
    found = []
    if len(known := run.known) > 1:
        best = [looks[s.key].label for s in standings]
        found = [
            _section("time", errors.against_time_overall(run, standings)),
            _section("error-per-scene", errors.by_scene(run, known, standings)),
            _cumulative("cumulative", errors.cumulative_overall(run, known, standings), best),
        ]
    return found + [_section(name, drawing, drawing.rules) for name, drawing in rankings(results.frame, looks).items()]


def of_scene(
    run: errors.Run, scene: Scene, curves: Mapping[Place, Mapping[Configured, Sequence[Curve]]]
) -> list[Section]:
    """Error against time, spread, cumulative errors and error over iterations on one scene."""
    points = {key: q for key, e in run.of(scene).items() if len(q := errors.quantiles(e))}
    if not points:
        return []
    best = sorted(points, key=lambda key: float(points[key][MIDDLE]))
    name = "-".join(scene.place)
    spread = errors.spreads(errors.ordered(run, best), [scene])
    curves_of_errors = errors.cumulative(errors.ordered(run, [key for key in run.looks if key in points]), [scene])
    found = [
        _section(anchor("time", name), errors.against_time(run, [scene])),
        _section(anchor("spread", name), replace(spread, title="Errors of the cameras")),
        _cumulative(anchor("cumulative", name), curves_of_errors, [run.looks[key].label for key in best]),
    ]
    if scene.place in curves:
        along = errors.iterations(run, {scene.place: curves[scene.place]})
        found.append(_section(anchor("iterations", name), along))
    return found


def _section(name: str, drawing: Drawing, *more: str) -> Section:
    how = (SPREAD,) if isinstance(drawing, Spreads) else ()
    return Section(name, drawing.title, tuple(filter(None, (*how, drawing.caption, *more))), paint(drawing))


def _cumulative(name: str, chart: Chart, best_first: Sequence[str]) -> Section:
    """A section of cumulative curves; the legend keeps the order of all others, only the best are shown at first."""
    drawn = {s.look.label for s in chart.panels[0].series}
    labels = [label for label in best_first if label in drawn]
    hidden = f" The best {SHOWN} of {len(labels)} are shown; the legend switches the others on."
    caption = f"{chart.caption}{hidden if len(labels) > SHOWN else ''}"
    return Section(name, chart.title, (caption,), paint(chart, labels[:SHOWN]))


def dependence(by_rule: Mapping[str, Sequence[Scene]]) -> Table:
    """Who is among the best on each scene under each alignment rule."""
    rows = []
    for k, scene in enumerate(next(iter(by_rule.values()))):
        best = [", ".join(e.label for e in scenes[k].entries if e.best) or None for scenes in by_rule.values()]
        if any(best):
            rows.append((words.spoken(scene), *best))
    return Table("Best median, and what cannot be told apart from it, by alignment", ("Scene", *by_rule), tuple(rows))
