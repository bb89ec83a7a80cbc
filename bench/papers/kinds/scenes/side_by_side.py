"""A table of scenes as the paper prints it, with what is measured here beside each published column."""

import math
from collections.abc import Iterator, Sequence

from bench.papers.kinds.scenes.grid import HEADS, error_text, head_of, marked, marks_of, scene_notes
from bench.papers.kinds.scenes.table import NOT_IN_PAPER, NOT_ON_DISK, Measured, Scenes
from bench.papers.published import FACTS
from bench.reporting.tables.grid import ABSENT, Cell, Grid

HERE, PAPER = "here", "paper"
_FACTS = {"n_cameras": (0, "{} cameras"), "edges_percent": (0, "{} % of edges"), "hardness": (4, "hardness {}")}


def side_by_side(found: Scenes) -> Grid:
    """One row a scene; for each published column what is measured, then what is published.

    What is near the reference by the paper's rule is highlighted, among measured and among published numbers.
    """
    marks = marks_of(found)
    places: dict[str, list[str]] = {}
    for quantity, method in found.columns():
        places.setdefault(quantity, []).append(method)
    rows = []
    for scene, cells in found.by_scene().items():
        by_key = {(row.quantity, row.method): row for row in cells}
        shown = [
            cell
            for quantity, methods in places.items()
            for cell in _cells([by_key[quantity, method] for method in methods])
        ]
        rows.append(((marked(scene, cells, marks), *(by_key[fact, ""].published for fact in FACTS)), tuple(shown)))
    statistic = found.table.statistic.removesuffix("_deg").capitalize()
    return Grid(
        caption=f"{found.table.title}; {HERE}: measured, {found.computed.alignment} alignment; {PAPER}: published",
        facts=("Name", *(HEADS[fact] for fact in FACTS)),
        methods=tuple(head for quantity, methods in places.items() for head in _heads(quantity, methods)),
        rows=tuple(rows),
        notes=(
            *scene_notes(found, marks, highlighted="Coloured"),
            *_facts(found.rows),
            f"{ABSENT}: not published, or not on disk here.",
        ),
        measure=f"{statistic} error (degrees)",
    )


def _heads(quantity: str, methods: Sequence[str]) -> Iterator[tuple[str, str]]:
    if quantity == NOT_IN_PAPER:
        yield from (head_of(quantity, method) for method in methods)
        return
    for method in filter(None, methods):
        params = method.partition("[")[2].removesuffix("]")
        yield quantity, f"{HERE},{params}" if params else HERE
    yield quantity, PAPER


def _cells(rows: Sequence[Measured]) -> Iterator[Cell]:
    for row in rows:
        if row.method:
            yield Cell(ABSENT if row.status == NOT_ON_DISK else error_text(row), highlight=row.near_measured)
    if rows[0].quantity != NOT_IN_PAPER:
        yield Cell(rows[0].published or ABSENT, highlight=rows[0].near_published)


def _facts(rows: Sequence[Measured]) -> Iterator[str]:
    """Where what is known of a scene is not what was published."""
    differing: dict[str, list[str]] = {}
    for row in (row for row in rows if row.quantity in FACTS):
        digits, text = _FACTS[row.quantity]
        if math.isfinite(row.measured) and row.published and round(row.measured, digits) != float(row.published):
            differing.setdefault(row.scene, []).append(text.format(f"{row.measured:.{digits}f}"))
    if differing:
        scenes = "; ".join(f"{scene}: {', '.join(facts)}" for scene, facts in differing.items())
        yield f"Cameras, edges and hardness are as published. {HERE.capitalize()} they are, {scenes}."
