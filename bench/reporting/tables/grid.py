"""The table of a paper: a row for each scene, a column for each method, "mean / median" in the cells.

`Grid` is any table of that shape.
"""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import pandas as pd

from bench.reporting import appearance
from bench.reporting.tables.printed import area, degrees, exact_seconds, speedup
from bench.reporting.tables.rows import (
    HARDNESS_LEGEND,
    ROC_LEGEND,
    SEEDS_LEGEND,
    TIE_LEGEND,
    Entry,
    Scene,
    Ties,
    Value,
    scenes,
    times_note,
)
from bench.scoring.results import Configured

ABBREVIATIONS = {
    "timeout": "TO",
    "out-of-memory": "OOM",
    "crashed": "CR",
    "error": "ERR",
    "invalid-output": "INV",
    "skipped": "SK",
    "not-installed": "NI",
    "not-run": "NR",
}
UNKNOWN = "n/t"
PARTIAL = "†"
ABSENT = "–"
ROC = "ROC AUC"
_NUMBER = re.compile(r"[−+-]?[\d.,]*(?: %)?|–")
TIME, FASTER = "median / min s", "times faster"


@dataclass(frozen=True)
class Cell:
    """What stands in a place of a table, bold or on a coloured ground where it stands out."""

    text: str
    bold: bool = False
    highlight: bool = False


@dataclass(frozen=True)
class Grid:
    """One table.

    Parameters
    ----------
    caption
        What stands above or below it.
    facts
        Heads of the columns at the left, names first and then what is known of them.
    methods
        Heads of the other columns: a title, and parameters or "".
    rows
        Facts and cells of each row; a row whose first fact is empty belongs to the one above it.
    notes
        What stands below.
    measure
        What the cells are, as a head over all methods; "" for none.
    """

    caption: str
    facts: tuple[str, ...]
    methods: tuple[tuple[str, str], ...]
    rows: tuple[tuple[tuple[str, ...], tuple[Cell, ...]], ...]
    notes: tuple[str, ...]
    measure: str = ""


def named_facts(grid: Grid) -> list[bool]:
    """Which columns of facts hold names, set at the left, and not numbers: the first, and others by most cells."""
    cells = [[facts[k] for facts, _ in grid.rows] for k in range(len(grid.facts))]
    return [k == 0 or 2 * sum(_NUMBER.fullmatch(c) is None for c in own) > len(own) for k, own in enumerate(cells)]


def parts_of(grid: Grid, count: int) -> list[Grid]:
    """The same table in equal parts, the facts in each; the notes go below the last."""
    size = -(-len(grid.methods) // count)
    return [
        replace(
            grid,
            caption=f"{grid.caption} (part {part + 1} of {count})" if count > 1 else grid.caption,
            methods=grid.methods[part * size : (part + 1) * size],
            rows=tuple((facts, cells[part * size : (part + 1) * size]) for facts, cells in grid.rows),
            notes=grid.notes if part == count - 1 else (),
        )
        for part in range(count)
    ]


def markdown(tables: Sequence[Grid], footnotes: Sequence[str] = ()) -> str:
    """Markdown tables, notes below each and the footnotes at the end."""
    parts = []
    for grid in tables:
        header = [*grid.facts, *(f"{title} {params}".strip() for title, params in grid.methods)]
        align = [*(":--" if named else "--:" for named in named_facts(grid)), *(":-:" for _ in grid.methods)]
        lines = [_pipes(map(markdown_escape, header)), _pipes(align)]
        for facts, cells in grid.rows:
            shown = (f"**{markdown_escape(c.text)}**" if c.bold else markdown_escape(c.text) for c in cells)
            lines.append(_pipes([*map(markdown_escape, facts), *shown]))
        notes = [f"- {markdown_escape(note)}" for note in grid.notes]
        parts.append("\n".join([f"**{markdown_escape(grid.caption)}**", "", *lines, "", *notes]))
    if footnotes:
        parts.append("\n".join(["Notes:", "", *(f"- {markdown_escape(note)}" for note in footnotes)]))
    return "\n\n".join(parts) + "\n"


def grids(frame: pd.DataFrame, ties: Ties) -> list[Grid]:
    """A table for each dataset, protocol and alignment."""
    groups: dict[tuple[str, str, str], list[Scene]] = {}
    for scene in scenes(frame, ties):
        groups.setdefault((scene.dataset, scene.protocol, scene.alignment), []).append(scene)
    timing = f"{times_note(frame)[0].upper()}{times_note(frame)[1:]}." if "speedup" in frame else ""
    return [_grid(group, timing) for group in groups.values()]


def _grid(group: Sequence[Scene], timing: str) -> Grid:
    first = group[0]
    methods = _methods(group)
    columns: list[tuple[str, Callable[[Scene], str]]] = [
        ("Scene", lambda s: s.instance),
        ("Cameras", lambda s: str(s.cameras)),
        ("Edges %", lambda s: f"{s.edges_percent:.1f}" if math.isfinite(s.edges_percent) else ABSENT),
        ("Hardness", lambda s: f"{s.hardness:.4f}" if math.isfinite(s.hardness) else ABSENT),
    ]
    shown = [(n, f) for n, f in columns if any(f(s) != ABSENT for s in group)]
    rows = []
    for scene in group:
        entries = [scene.entry(method) for method in methods]
        rows.append((tuple(fact(scene) for _, fact in shown), tuple(_cell(scene, entry) for entry in entries)))
        further = [(TIME, _time), (FASTER, speedup)] if timing else []
        further += [(ROC, _area)] if scene.has_roc else []
        for label, of in further:
            below = ("", *[""] * (len(shown) - 2), label)
            rows.append((below, tuple(Cell(of(entry) if entry else ABSENT) for entry in entries)))
    notes = _notes(group, [cell.text for _, cells in rows for cell in cells])
    return Grid(
        caption=f"{first.dataset}: mean / median error in degrees, {first.alignment} alignment, "
        f"protocol {first.protocol}",
        facts=tuple(name for name, _ in shown),
        methods=tuple(methods.values()),
        rows=tuple(rows),
        notes=(*notes, timing) if timing else tuple(notes),
        measure="Mean / median error (degrees)",
    )


def _methods(group: Sequence[Scene]) -> dict[Configured, tuple[str, str]]:
    """Title and parameters of every configured method; the id is added where two share both."""
    titles = {e.key: e.title for scene in group for e in scene.entries}
    heads = {key: appearance.current().head(*key, title) for key, title in titles.items()}
    shown = list(heads.values())
    return {key: head if shown.count(head) == 1 else (f"{head[0]} ({key[0]})", head[1]) for key, head in heads.items()}


def _cell(scene: Scene, entry: Entry | None) -> Cell:
    if entry is None:
        return Cell(ABSENT)
    if not entry.ok:
        return Cell("/".join(ABBREVIATIONS.get(ended, ended) for ended in entry.outcomes))
    if not scene.has_truth:
        return Cell(UNKNOWN)
    mean, median = (_with_spread(entry.values[name]) for name in ("mean_deg", "median_deg"))
    most = max(e.scored for e in scene.entries)
    marks = PARTIAL * (entry.scored < most) + f" ({entry.ok}/{entry.seeds})" * (entry.ok < entry.seeds)
    return Cell(f"{mean} / {median}{marks}", entry.best)


def _time(entry: Entry) -> str:
    return " / ".join(exact_seconds(entry.values[name].mean) for name in ("solve_s", "min_s"))


def _area(entry: Entry) -> str:
    return area(entry.value("roc_auc").mean)


def _with_spread(value: Value) -> str:
    """A mean over seeds and the half-width of its interval, where there are several."""
    return (
        f"{_short(value.mean)} ±{_short(value.half_width)}" if math.isfinite(value.half_width) else _short(value.mean)
    )


def _short(value: float) -> str:
    """Three digits from 10 degrees on, where hundredths only cost width."""
    return f"{value:.1f}" if value >= 10 else degrees(value)


def abbreviated(status: str) -> str:
    """A status in the width of a cell."""
    return ABBREVIATIONS.get(re.split(r"[(:]", status, maxsplit=1)[0].strip(), status)


def _notes(group: Sequence[Scene], cells: Sequence[str]) -> list[str]:
    """What bold and the marks that occur mean, and every failure and note in full."""
    text = " ".join(cells)
    notes = [f"Bold: {TIE_LEGEND}."] if any(e.best for scene in group for e in scene.entries) else []
    legend = {
        PARTIAL: "fewer cameras scored than by another method",
        UNKNOWN: "solved, but no camera has ground truth",
        ABSENT: "not in this run, or no edge weights" if any(s.has_roc for s in group) else "not in this run",
    }
    counted = re.search(r"\(\d+/\d+\)", text) is not None
    marks = [f"{mark}: {meaning}" for mark, meaning in legend.items() if mark in text]
    marks += ["(k/s): only k of s seeds ended well"] if counted else []
    if any(math.isfinite(scene.hardness) for scene in group):
        marks.append(HARDNESS_LEGEND)
    if any(scene.has_roc for scene in group):
        marks.append(f"{ROC}: {ROC_LEGEND}")
    used = set(re.split(r"[ /]", text))
    marks += [f"{short}: {name}" for name, short in ABBREVIATIONS.items() if short in used]
    if any(e.seeds > 1 for scene in group for e in scene.entries):
        marks.append(SEEDS_LEGEND)
    notes += [f"{'; '.join(marks)}."] if marks else []
    remarks = [
        (entry.label, remark, scene.instance)
        for scene in group
        for entry in scene.entries
        for remark in filter(None, (entry.failure, *entry.notes))
    ]
    return notes + gathered(remarks)


def gathered(remarks: Iterable[tuple[str, str, str]]) -> list[str]:
    """A sentence for each remark on a method, with the instances it was made on, from (method, remark, instance)."""
    said: dict[str, dict[str, list[str]]] = {}
    for label, remark, instance in remarks:
        said.setdefault(label, {}).setdefault(remark, []).append(instance)
    return [
        f"{label}: {remark} [{', '.join(names)}]"
        for label, remarks_on in said.items()
        for remark, names in remarks_on.items()
    ]


def _pipes(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def markdown_escape(text: str) -> str:
    """Text that Markdown shows as it is, in a table cell too."""
    flat = " ".join(str(text).split())
    flat = flat.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return re.sub(r"([\\`*_\[\]|~#$])", r"\\\1", flat)
