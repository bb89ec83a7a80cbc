"""A published table of errors as the paper prints it, with what is measured here beside each published column."""

import math
from collections.abc import Iterator

import pandas as pd

from bench.papers.computed import Computed
from bench.papers.items.scenes import NOT_ON_DISK, SceneTable
from bench.papers.published import FACTS
from bench.papers.tables.paper import HEADS, error_text, marks_of, scene_notes
from bench.reporting.tables.grid import ABSENT, Cell, Grid

HERE, PAPER = "here", "paper"
_FACTS = {"n_cameras": (0, "{} cameras"), "edges_percent": (0, "{} % of edges"), "hardness": (4, "hardness {}")}


def side_by_side(table: SceneTable, frame: pd.DataFrame, computed: Computed, alignment: str) -> Grid:
    """One row a scene; for each published column what is measured, then what is published.

    What is near the reference by the paper's rule is highlighted, among measured and among published numbers.

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
    places = [(quantity, list(own["method"])) for quantity, own in columns.groupby("quantity", sort=False)]
    heads = [head for quantity, methods in places for head in _heads(str(quantity), methods)]
    rows = []
    for scene, cells in frame.groupby("scene", sort=False):
        by_key = {(row.quantity, row.method): row for row in cells.itertuples()}
        instance = cells["instance"].iloc[0]
        label = f"{scene} ({marks[instance][0]})" if instance in marks else str(scene)
        shown = [
            cell for quantity, methods in places for cell in _cells([by_key[quantity, method] for method in methods])
        ]
        rows.append(((label, *(by_key[fact, ""].published for fact in FACTS)), tuple(shown)))
    statistic = table.statistic.removesuffix("_deg").capitalize()
    return Grid(
        caption=f"{table.title}; {HERE}: measured, {alignment} alignment; {PAPER}: published",
        facts=("Name", *(HEADS[fact] for fact in FACTS)),
        methods=tuple(heads),
        rows=tuple(rows),
        notes=(
            *scene_notes(table, frame, computed, marks, highlighted="Coloured"),
            *_facts(frame),
            f"{ABSENT}: not published, or not on disk here.",
        ),
        measure=f"{statistic} error (degrees)",
    )


def _heads(quantity: str, methods: list[str]) -> Iterator[tuple[str, str]]:
    for method in filter(None, methods):
        params = method.partition("[")[2].removesuffix("]")
        yield quantity, f"{HERE},{params}" if params else HERE
    yield quantity, PAPER


def _cells(rows: "list[object]") -> Iterator[Cell]:
    for row in rows:
        if row.method:  # type: ignore[attr-defined]
            absent = row.status == NOT_ON_DISK  # type: ignore[attr-defined]
            yield Cell(ABSENT if absent else error_text(row), highlight=bool(row.near_measured))  # type: ignore[attr-defined]
    first = rows[0]
    yield Cell(first.published or ABSENT, highlight=bool(first.near_published))  # type: ignore[attr-defined]


def _facts(frame: pd.DataFrame) -> Iterator[str]:
    """Where what is known of a scene is not what was published."""
    differing: dict[str, list[str]] = {}
    for row in frame[frame["quantity"].isin(FACTS)].itertuples():
        digits, text = _FACTS[row.quantity]
        if math.isfinite(row.measured) and row.published and round(row.measured, digits) != float(row.published):
            differing.setdefault(row.scene, []).append(text.format(f"{row.measured:.{digits}f}"))
    if differing:
        scenes = "; ".join(f"{scene}: {', '.join(facts)}" for scene, facts in differing.items())
        yield f"Cameras, edges and hardness are as published. {HERE.capitalize()} they are, {scenes}."
