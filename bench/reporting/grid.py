"""The table of a paper: a row for each scene, a column for each method, "mean / median" in the cells.

`Grid` and its two renderers are for any table of that shape.
"""

import math
import re
import textwrap
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import pandas as pd

from bench.reporting.rows import ROC_LEGEND, TIE_LEGEND, Configured, Entry, Scene, Ties, area, degrees, scenes

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
LATEX_COLUMNS = 9  # methods that fit the width of a page

_TEX = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': "''",
    "–": "--",
    "—": "---",
    "·": r"$\cdot$",
    "±": r"$\pm$",
    "°": r"$^\circ$",
    "†": r"$\dagger$",
    "½": r"$\frac{1}{2}$",
    "ℓ": r"$\ell$",
    "λ": r"$\lambda$",
    "²": r"$^2$",
    "…": r"\dots{}",
    "−": "$-$",
    "≤": r"$\le$",
    "≥": r"$\ge$",
    "→": r"$\to$",
}
_TEX |= {c: f"\\{c}" for c in "{}$&%#_"}
_TEX |= {c: f"{{{c}}}" for c in "[]*"}  # after a line break these would be its options


@dataclass(frozen=True)
class Cell:
    """What stands in a place of a table, bold where it stands out."""

    text: str
    bold: bool = False


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
    """

    caption: str
    facts: tuple[str, ...]
    methods: tuple[tuple[str, str], ...]
    rows: tuple[tuple[tuple[str, ...], tuple[Cell, ...]], ...]
    notes: tuple[str, ...]


def render_markdown(frame: pd.DataFrame, ties: Ties, footnotes: Sequence[str]) -> str:
    """Markdown tables, best and ties bold, what the marks mean and the footnotes below."""
    return markdown(_grids(frame, ties), footnotes)


def render_latex(frame: pd.DataFrame, ties: Ties, footnotes: Sequence[str]) -> str:
    r"""LaTeX ``table*`` environments; the document needs ``\usepackage{booktabs}`` and nothing else."""
    return latex(_grids(frame, ties), footnotes)


def markdown(grids: Sequence[Grid], footnotes: Sequence[str] = ()) -> str:
    """Markdown tables, notes below each and the footnotes at the end."""
    parts = []
    for grid in grids:
        header = [*grid.facts, *(f"{title} {params}".strip() for title, params in grid.methods)]
        align = [":--", *("--:" for _ in grid.facts[1:]), *(":-:" for _ in grid.methods)]
        lines = [_pipes(map(markdown_escape, header)), _pipes(align)]
        for facts, cells in grid.rows:
            shown = (f"**{markdown_escape(c.text)}**" if c.bold else markdown_escape(c.text) for c in cells)
            lines.append(_pipes([*map(markdown_escape, facts), *shown]))
        notes = [f"- {markdown_escape(note)}" for note in grid.notes]
        parts.append("\n".join([f"**{markdown_escape(grid.caption)}**", "", *lines, "", *notes]))
    if footnotes:
        parts.append("\n".join(["Notes:", "", *(f"- {markdown_escape(note)}" for note in footnotes)]))
    return "\n\n".join(parts) + "\n"


def latex(grids: Sequence[Grid], footnotes: Sequence[str] = ()) -> str:
    """LaTeX tables; the footnotes go below the last."""
    parts = [part for grid in grids for part in _split(grid)]
    tables = [_latex_table(part, footnotes if part is parts[-1] else ()) for part in parts]
    return "% needs \\usepackage{booktabs}\n" + "\n".join(tables)


def _split(grid: Grid) -> list[Grid]:
    """The same table in parts that fit a page's width; the notes go below the last."""
    count = -(-len(grid.methods) // LATEX_COLUMNS)
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


def _latex_table(grid: Grid, footnotes: Sequence[str]) -> str:
    header = [*map(latex_escape, grid.facts), *(_latex_header(*method) for method in grid.methods)]
    lines = [
        r"\begin{table*}[htbp]",
        r"\centering",
        rf"\caption{{{latex_escape(grid.caption)}}}",
        r"\scriptsize" if len(grid.methods) > 6 else r"\footnotesize",
        r"\setlength{\tabcolsep}{3pt}",
        rf"\begin{{tabular}}{{l{'r' * (len(grid.facts) - 1)}{'c' * len(grid.methods)}}}",
        r"\toprule",
        rf"{' & '.join(header)} \\",
        r"\midrule",
    ]
    grouped = False
    for facts, cells in grid.rows:
        shown = (rf"\textbf{{{latex_escape(c.text)}}}" if c.bold else latex_escape(c.text) for c in cells)
        if grouped and facts[0]:
            lines.append(r"\addlinespace")
        grouped = not facts[0]
        lines.append(rf"{' & '.join([*map(latex_escape, facts), *shown])} \\")
    lines += [r"\bottomrule", r"\end{tabular}", ""]
    lines += [rf"\par\smallskip\raggedright {latex_escape(note)}" for note in (*grid.notes, *footnotes)]
    return "\n".join([*lines, r"\end{table*}", ""])


def _latex_header(title: str, params: str) -> str:
    """A narrow column head: a word or two a line."""
    lines = textwrap.wrap(title, 10, break_long_words=False)
    for parameter in filter(None, params.split(",")):
        lines += [parameter] if len(parameter) <= 10 else parameter.replace("=", "=\n").split("\n")
    stacked = r" \\ ".join(map(latex_escape, lines))
    return rf"\begin{{tabular}}[b]{{@{{}}c@{{}}}}{stacked}\end{{tabular}}"


def _grids(frame: pd.DataFrame, ties: Ties) -> list[Grid]:
    groups: dict[tuple[str, str, str], list[Scene]] = {}
    for scene in scenes(frame, ties):
        groups.setdefault((scene.dataset, scene.protocol, scene.alignment), []).append(scene)
    return [_grid(group) for group in groups.values()]


def _grid(group: Sequence[Scene]) -> Grid:
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
        by_method = {(e.method, e.params): e for e in scene.entries}
        cells = tuple(_cell(scene, by_method.get(method)) for method in methods)
        rows.append((tuple(fact(scene) for _, fact in shown), cells))
        if scene.has_roc:
            areas = (by_method[m].roc_auc.mean if m in by_method else math.nan for m in methods)
            rows.append((("", *[""] * (len(shown) - 2), ROC), tuple(Cell(area(value)) for value in areas)))
    return Grid(
        caption=f"{first.dataset}: mean / median error in degrees, {first.alignment} alignment, "
        f"protocol {first.protocol}",
        facts=tuple(name for name, _ in shown),
        methods=tuple(methods.values()),
        rows=tuple(rows),
        notes=tuple(_notes(group, [cell.text for _, cells in rows for cell in cells])),
    )


def _methods(group: Sequence[Scene]) -> dict[Configured, tuple[str, str]]:
    """Title and parameters of every configured method; the id is added where two share both."""
    entries = {(e.method, e.params): e for scene in group for e in scene.entries}
    heads = [(e.title, e.params) for e in entries.values()]
    return {
        key: (e.title if heads.count((e.title, e.params)) == 1 else f"{e.title} ({e.method})", e.params)
        for key, e in entries.items()
    }


def _cell(scene: Scene, entry: Entry | None) -> Cell:
    if entry is None:
        return Cell(ABSENT)
    if not entry.ok:
        return Cell("/".join(dict.fromkeys(abbreviated(status) for status in entry.failures)))
    if not scene.has_truth:
        return Cell(UNKNOWN)
    mean, median = (_short(entry.values[name].mean) for name in ("mean_deg", "median_deg"))
    most = max(e.scored for e in scene.entries)
    marks = PARTIAL * (entry.scored < most) + f" ({entry.ok}/{entry.seeds})" * (entry.ok < entry.seeds)
    return Cell(f"{mean} / {median}{marks}", entry.best)


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
        "(": "(k/s) only k of s seeds ended well",
        UNKNOWN: "solved, but no camera has ground truth",
        ABSENT: "not in this run, or no edge weights" if any(s.has_roc for s in group) else "not in this run",
    }
    marks = [meaning if mark == "(" else f"{mark}: {meaning}" for mark, meaning in legend.items() if mark in text]
    if any(scene.has_roc for scene in group):
        marks.append(f"{ROC}: {ROC_LEGEND}")
    used = set(re.split(r"[ /]", text))
    marks += [f"{short}: {name}" for name, short in ABBREVIATIONS.items() if short in used]
    if any(e.seeds > 1 for scene in group for e in scene.entries):
        marks.append("figures are means over seeds")
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


def latex_escape(text: str) -> str:
    """Text that LaTeX prints as it is."""
    escaped = "".join(_TEX.get(c, c) for c in " ".join(str(text).split()))
    return escaped.replace("--", "-{}-") if "--" in str(text) else escaped
