"""The points of a figure as a table."""

import math
from collections.abc import Iterator

from bench.papers.kinds.curves.plot import Curves, Point
from bench.reporting.tables.grid import Cell, Grid
from bench.reporting.tables.rows import degrees


def point_grid(found: Curves) -> Grid:
    """A row for each panel and place on the axis, a column for each curve."""
    plot = found.plot
    places: dict[tuple[float, float], dict[str, Point]] = {}
    for point in found.rows:
        places.setdefault((point.panel, point.x), {})[point.curve] = point
    curves = [curve.label for curve in plot.curves]
    return Grid(
        caption=f"{plot.title}; degrees, {found.computed.alignment} alignment, {plot.dataset}",
        facts=(plot.panel.parameter, plot.axis.parameter),
        methods=tuple((name, "") for name in curves),
        rows=tuple(
            (tuple(f"{value:g}" for value in place), tuple(Cell(_text(by_curve[name])) for name in curves))
            for place, by_curve in places.items()
        ),
        notes=tuple(notes(found)),
    )


def _text(point: Point) -> str:
    spread = f" ±{degrees(point.half_width_deg)}" if math.isfinite(point.half_width_deg) else ""
    return f"{degrees(point.error_deg)}{spread}{f' ({point.ok}/{point.seeds})' if point.ok < point.seeds else ''}"


def notes(found: Curves) -> Iterator[str]:
    """What the figures are means of, and what is noted of problems and methods."""
    seeds = max(point.seeds for point in found.rows)
    yield f"Means over {seeds} seeds with their 95 % t intervals." if seeds > 1 else "One seed."
    names = {job.dataset: job.instance for job in found.computed.jobs}
    said: dict[str, list[str]] = {}
    for curve in dict.fromkeys(point.curve for point in found.rows):
        own = [point for point in found.rows if point.curve == curve]
        remarks = [note for point in own for note in found.computed.notes.get(names.get(point.dataset, ""), ())]
        if (share := min(point.scored_percent for point in own)) < 100:
            remarks.append(
                f"solved and scored on the largest component of each graph, at least {share:.1f} % of the cameras"
            )
        for note in dict.fromkeys(remarks):
            said.setdefault(note, []).append(curve)
    yield from (f"{' and '.join(curves)}: {note}." for note, curves in said.items())
    if any(point.ok < point.seeds for point in found.rows):
        yield "(k/s): only k of s seeds ended well."
