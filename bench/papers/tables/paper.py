"""What was measured beside what a paper has published, as tables."""

import math
from collections.abc import Iterator, Mapping, Sequence

import pandas as pd

from bench.papers.computed import Computed
from bench.papers.items.curves import CurvePlot
from bench.papers.items.properties import PropertyTable
from bench.papers.items.scenes import NO_TRUTH, NOT_ON_DISK, PUBLISHED_ONLY, SceneTable
from bench.papers.published import FACTS
from bench.plugins import selection
from bench.reporting.tables.console import render_grid
from bench.reporting.tables.grid import ABBREVIATIONS, ABSENT, UNKNOWN, Cell, Grid, abbreviated, gathered, markdown
from bench.reporting.tables.latex import latex
from bench.reporting.tables.rows import OK, degrees

HEADS = {"n_cameras": "Cameras", "edges_percent": "Edges %", "hardness": "Hardness"}
_DIGITS = {"n_cameras": 0, "edges_percent": 1, "hardness": 4}
_ERROR_DIGITS = 2
_MARKS = "abcdefghijklmnopqrstuvwxyz"


def render(
    grid: Grid, frame: pd.DataFrame, style: str, *, width: int = 100, terminal: bool = False
) -> tuple[str, tuple[str, ...]]:
    """Text of a table, and the notes that are not in it (all of them for ``csv``, none otherwise)."""
    if style == "csv":
        return frame.to_csv(index=False), grid.notes
    if style == "console":
        return render_grid(grid, width=width, terminal=terminal), ()
    return (markdown if style == "markdown" else latex)([grid]), ()


def scene_grid(table: SceneTable, frame: pd.DataFrame, computed: Computed, alignment: str) -> Grid:
    """Three rows a scene: measured, published, difference; the paper's row alone where nothing is on disk.

    Parameters
    ----------
    table, frame
        The layout, and what its `compare` gave.
    computed
        What the notes on scenes, methods and missing data are taken from.
    alignment
        The rule that removed the gauge.
    """
    marks = marks_of(frame, computed)
    columns = frame.loc[~frame["quantity"].isin(FACTS), ["quantity", "method"]].drop_duplicates()
    keys = list(columns.itertuples(index=False, name=None))
    rows = []
    for scene, cells in frame.groupby("scene", sort=False):
        by_key = {(row.quantity, row.method): row for row in cells.itertuples()}
        facts, errors = [by_key[fact, ""] for fact in FACTS], [by_key[key] for key in keys]
        label = f"{scene} ({marks[cells['instance'].iloc[0]][0]})" if cells["instance"].iloc[0] in marks else str(scene)
        published = [*(row.published for row in facts)], [Cell(r.published or ABSENT, r.near_published) for r in errors]
        if facts[0].status == NOT_ON_DISK:
            rows.append(((label, "published", *published[0]), tuple(published[1])))
            continue
        here = tuple(_fixed(row.measured, _DIGITS[row.quantity]) for row in facts)
        off = tuple(_signed(row.difference, _DIGITS[row.quantity]) for row in facts)
        rows.append(((label, "measured", *here), tuple(Cell(error_text(r), r.near_measured) for r in errors)))
        rows.append((("", "published", *published[0]), tuple(published[1])))
        rows.append((("", "difference", *off), tuple(Cell(_signed(r.difference, _ERROR_DIGITS)) for r in errors)))
    return Grid(
        caption=f"{table.title}; {alignment} alignment, {table.dataset}",
        facts=("Scene", "", *(HEADS[fact] for fact in FACTS)),
        methods=tuple((column, _parameters(method)) for column, method in keys),
        rows=tuple(rows),
        notes=tuple(scene_notes(table, frame, computed, marks)),
    )


def marks_of(frame: pd.DataFrame, computed: Computed) -> dict[str, tuple[str, str]]:
    """A letter and what it says for each instance whose data or truth are not the paper's."""
    noted = {name: "; ".join(notes) for name, notes in (computed.notes or {}).items() if notes}
    ordered = [name for name in dict.fromkeys(frame["instance"]) if name in noted]
    return {name: (letter, noted[name]) for name, letter in zip(ordered, _MARKS, strict=False)}


def scene_notes(
    table: SceneTable,
    frame: pd.DataFrame,
    computed: Computed,
    marks: Mapping[str, tuple[str, str]],
    highlighted: str = "Bold, or *",
) -> Iterator[str]:
    """What stands out, the letters at scenes, abbreviations, failures and notes, and what is missing."""
    first = next(iter(table.measured[table.highlight_reference]), "")
    among = f"; measured: from {first}" if first else ""
    yield (
        f"{highlighted}: at most {table.highlight_deg:g} degrees from {table.highlight_reference} in the same row, the "
        f"paper's rule{among}."
    )
    for letter, note in marks.values():
        yield f"({letter}) {note}."
    only = list(dict.fromkeys(frame.loc[frame["status"] == PUBLISHED_ONLY, "quantity"]))
    legend = [f"{', '.join(only)}: published only"] if only else []
    legend += [f"{UNKNOWN}: solved, but no camera has ground truth"] if (frame["status"] == NO_TRUTH).any() else []
    used = {abbreviated(status) for status in frame["status"]}
    legend += [f"{short}: {name}" for name, short in ABBREVIATIONS.items() if short in used]
    if legend:
        yield f"{'; '.join(legend)}."
    if computed.results is not None:
        rows = computed.results.frame
        labels = [f"{m}[{p}]" if p else str(m) for m, p in zip(rows["method"], rows["params"], strict=True)]
        for column, kept in (("status", rows["status"] != OK), ("notes", rows["notes"] != "")):
            found = zip(labels, rows[column], rows["instance"], kept, strict=True)
            yield from gathered((label, str(remark), str(scene)) for label, remark, scene, keep in found if keep)
    yield from (f"{sentence[0].upper()}{sentence[1:]}." for sentence in computed.missing)


def error_text(row: "object") -> str:
    """A measured error, or why there is none."""
    measured, status = float(row.measured), str(row.status)  # type: ignore[attr-defined]
    if math.isfinite(measured):
        return f"{measured:.{_ERROR_DIGITS}f}"
    return {PUBLISHED_ONLY: ABSENT, NO_TRUTH: UNKNOWN}.get(status) or abbreviated(status)


def _fixed(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else ABSENT


def _signed(value: float, digits: int) -> str:
    """With a sign that is as wide as a plus; nothing where one of the two is missing."""
    if not math.isfinite(value):
        return ""
    text = f"{value:+.{digits}f}".replace("-", "−")
    return text[1:] if float(text.replace("−", "-")) == 0 else text


def _parameters(method: str) -> str:
    """What a head says of a measured method besides the published column's name."""
    return selection.format_parameters(selection.parse(method).combinations()[0]) if method else ""


def property_grid(table: PropertyTable, frame: pd.DataFrame) -> Grid:
    """A row for each method; declared and published side by side for each property."""
    rows = []
    differing = False
    for name, cells in frame.groupby("name", sort=False):
        shown = []
        for row in cells.itertuples():
            differs = row.agree is False
            differing |= differs
            shown += [Cell(_word(row.declared), differs), Cell(_word(row.published), differs)]
        rows.append(((str(name), cells["method"].iloc[0] or ABSENT), tuple(shown)))
    heads = [(heading, kind) for heading in table.columns for kind in ("declared", "published")]
    agree = "Bold: the two differ." if differing else "What is declared here agrees with what is published."
    return Grid(
        caption=table.title,
        facts=("Method", "here"),
        methods=tuple(heads),
        rows=tuple(rows),
        notes=(agree, f"{ABSENT}: not here, or not in the paper's table."),
    )


def _word(known: bool | None) -> str:
    return ABSENT if known is None else "yes" if known else "no"


def point_grid(plot: CurvePlot, points: pd.DataFrame, alignment: str, notes: Sequence[str]) -> Grid:
    """A row for each panel and place on the axis, a column for each curve."""
    keys = [plot.panel.parameter, plot.axis.parameter]
    curves = [curve.label for curve in plot.curves]
    rows = []
    for place, cells in points.groupby(keys, sort=False):
        by_curve = {row.curve: row for row in cells.itertuples()}
        facts = tuple(f"{value:g}" for value in place)
        rows.append((facts, tuple(Cell(_point(by_curve[name], plot.statistic)) for name in curves)))
    return Grid(
        caption=f"{plot.title}; degrees, {alignment} alignment, {plot.dataset}",
        facts=tuple(keys),
        methods=tuple((name, "") for name in curves),
        rows=tuple(rows),
        notes=tuple(notes),
    )


def _point(row: "object", statistic: str) -> str:
    mean, half, ok, seeds = (getattr(row, name) for name in (statistic, "half_width_deg", "ok", "seeds"))
    spread = f" ±{degrees(half)}" if math.isfinite(half) else ""
    return f"{degrees(mean)}{spread}{f' ({ok}/{seeds})' if ok < seeds else ''}"


def point_notes(plot: CurvePlot, points: pd.DataFrame, computed: Computed) -> tuple[str, ...]:
    """What the figures are means of, and what is noted of problems and methods."""
    seeds = int(points["seeds"].max())
    notes = [f"Means over {seeds} seeds with their 95 % t intervals." if seeds > 1 else "One seed."]
    said: dict[str, list[str]] = {}
    names = {job.dataset: job.instance for job in computed.jobs}
    for curve, cells in points.groupby("curve", sort=False):
        for note in dict.fromkeys(n for text in cells["dataset"] for n in (computed.notes or {}).get(names[text], ())):
            said.setdefault(note, []).append(str(curve))
        if (share := cells["scored_percent"].min()) < 100:
            note = f"solved and scored on the largest component of each graph, at least {share:.1f} % of the cameras"
            said.setdefault(note, []).append(str(curve))
    notes += [f"{' and '.join(curves)}: {note}." for note, curves in said.items()]
    if (points["ok"] < points["seeds"]).any():
        notes.append("(k/s): only k of s seeds ended well.")
    return tuple(notes)
