"""A table of scenes with three rows each: measured, published, difference."""

import math
from collections.abc import Iterator, Mapping

from bench.papers.kinds.scenes.table import NO_TRUTH, NOT_IN_PAPER, NOT_ON_DISK, PUBLISHED_ONLY, Measured, Scenes
from bench.papers.published import FACTS
from bench.reporting.tables.grid import ABBREVIATIONS, ABSENT, UNKNOWN, Cell, Grid, abbreviated, gathered
from bench.reporting.tables.rows import HARDNESS_LEGEND

HEADS = {"n_cameras": "Cameras", "edges_percent": "Edges %", "hardness": "Hardness"}
_DIGITS = {"n_cameras": 0, "edges_percent": 1, "hardness": 4}
_ERROR_DIGITS = 2
_MARKS = "abcdefghijklmnopqrstuvwxyz"


def scene_grid(found: Scenes) -> Grid:
    """Three rows a scene; the paper's row alone where nothing is on disk."""
    marks = marks_of(found)
    columns = found.columns()
    rows = []
    for scene, cells in found.by_scene().items():
        by_key = {(row.quantity, row.method): row for row in cells}
        facts, errors = [by_key[fact, ""] for fact in FACTS], [by_key[key] for key in columns]
        label = marked(scene, cells, marks)
        published = tuple(row.published for row in facts)
        printed = tuple(Cell(row.published or ABSENT, row.near_published) for row in errors)
        if facts[0].status == NOT_ON_DISK:
            rows.append(((label, "published", *published), printed))
            continue
        here = tuple(_fixed(row.measured, _DIGITS[row.quantity]) for row in facts)
        off = tuple(_signed(row.difference, _DIGITS[row.quantity]) for row in facts)
        rows.append(((label, "measured", *here), tuple(Cell(error_text(row), row.near_measured) for row in errors)))
        rows.append((("", "published", *published), printed))
        differences = tuple(Cell(_signed(row.difference, _ERROR_DIGITS)) for row in errors)
        rows.append((("", "difference", *off), differences))
    return Grid(
        caption=f"{found.table.title}; {found.computed.alignment} alignment, {found.table.dataset}",
        facts=("Scene", "", *(HEADS[fact] for fact in FACTS)),
        methods=tuple(head_of(column, method) for column, method in columns),
        rows=tuple(rows),
        notes=tuple(scene_notes(found, marks)),
    )


def marks_of(found: Scenes) -> dict[str, tuple[str, str]]:
    """A letter and what it says for each instance whose data or truth are not the paper's."""
    noted = {name: "; ".join(notes) for name, notes in found.computed.notes.items() if notes}
    ordered = [name for name in dict.fromkeys(row.instance for row in found.rows) if name in noted]
    return {name: (letter, noted[name]) for name, letter in zip(ordered, _MARKS, strict=False)}


def marked(scene: str, cells: list[Measured], marks: Mapping[str, tuple[str, str]]) -> str:
    """The name of a scene with its letter."""
    instance = cells[0].instance
    return f"{scene} ({marks[instance][0]})" if instance in marks else scene


def scene_notes(found: Scenes, marks: Mapping[str, tuple[str, str]], highlighted: str = "Bold, or *") -> Iterator[str]:
    """What stands out, the letters at scenes, abbreviations, failures and notes, and what is missing."""
    table = found.table
    first = next(iter(table.measured[table.highlight_reference]), "")
    among = f"; measured: from {first}" if first else ""
    yield (
        f"{highlighted}: at most {table.highlight_deg:g} degrees from {table.highlight_reference} in the same row, the "
        f"paper's rule{among}."
    )
    yield from table.notes
    for letter, note in marks.values():
        yield f"({letter}) {note}."
    only = dict.fromkeys(row.quantity for row in found.rows if row.status == PUBLISHED_ONLY)
    statuses = {row.status for row in found.rows}
    legend = [f"{', '.join(only)}: published only"] if only else []
    legend += [f"{UNKNOWN}: solved, but no camera has ground truth"] if NO_TRUTH in statuses else []
    used = set(map(abbreviated, statuses))
    legend += [f"{short}: {name}" for name, short in ABBREVIATIONS.items() if short in used]
    yield f"{'; '.join([*legend, HARDNESS_LEGEND])}."
    scores = found.computed.scores
    yield from gathered((score.method, score.status, score.instance) for score in scores if not score.ok)
    yield from gathered((score.method, score.notes, score.instance) for score in scores if score.notes)
    yield from found.computed.remarks()


def error_text(row: Measured) -> str:
    """A measured error, or why there is none."""
    if math.isfinite(row.measured):
        return f"{row.measured:.{_ERROR_DIGITS}f}"
    return {PUBLISHED_ONLY: ABSENT, NO_TRUTH: UNKNOWN}.get(row.status) or abbreviated(row.status)


def _fixed(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else ABSENT


def _signed(value: float, digits: int) -> str:
    """With a sign that is as wide as a plus; nothing where one of the two is missing."""
    if not math.isfinite(value):
        return ""
    text = f"{value:+.{digits}f}".replace("-", "−")
    return text[1:] if float(text.replace("−", "-")) == 0 else text


def head_of(column: str, method: str) -> tuple[str, str]:
    """Title and parameters over a column: that of the paper, or the method itself where the paper has none."""
    name, _, params = method.removesuffix("]").partition("[")
    return (name if column == NOT_IN_PAPER else column), params
