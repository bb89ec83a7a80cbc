"""The table for a terminal: one block a scene, one line a method."""

import math
from collections.abc import Iterable, Iterator, Sequence

import pandas as pd
from rich import box
from rich.console import Console, RenderableType
from rich.measure import Measurement
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from bench.core.words import counted
from bench.reporting.tables.grid import Grid, named_facts, parts_of
from bench.reporting.tables.printed import area, degrees, exact_seconds, seconds, speedup
from bench.reporting.tables.rows import (
    HARDNESS_LEGEND,
    ROC_LEGEND,
    SEEDS_LEGEND,
    TIE_LEGEND,
    Entry,
    Scene,
    Ties,
    is_timed,
    scenes,
    times_note,
)

NO_TRUTH = " · no ground truth: edge residuals, not errors"
UNBOUNDED = 10_000  # columns
WIDE = 102  # columns from which the 90th percentile and the shares under 5 and 10 degrees fit


def render_console(
    frame: pd.DataFrame, ties: Ties, footnotes: Sequence[str], *, width: int = 100, terminal: bool = False
) -> str:
    """Text of the table, with escape codes for bold where it is for a terminal."""
    timed = is_timed(frame)
    blocks = [part for scene in scenes(frame, ties) for part in _block(scene, width, timed)]
    legend = (Text(line, style="dim") for line in _legend(frame))
    notes = [Text(), *(Text(f"- {note}") for note in footnotes)] if footnotes else []
    return _printed([*blocks, *legend, *notes], width, terminal)


def render_grid(grid: Grid, *, width: int = 100, terminal: bool = False) -> str:
    """Text of a table of another shape; what is bold is marked with an asterisk too.

    On a terminal that it is too wide for, it is printed in parts, the columns of facts in each.
    """
    counts = range(1, len(grid.methods) + 1) if terminal else ()
    split = (parts_of(grid, count) for count in counts)
    parts = next((some for some in split if max(_natural(_grid_table(part)) for part in some) <= width), [grid])
    tables = [piece for part in parts for piece in (Text(part.caption, style="bold"), _grid_table(part))]
    return _printed([*tables, *(Text(line, style="dim") for line in grid.notes)], width, terminal)


def _grid_table(grid: Grid) -> Table:
    table = _empty_table()
    for name, named in zip(grid.facts, named_facts(grid), strict=True):
        table.add_column(name, justify="left" if named else "right", overflow="fold")
    for title, params in grid.methods:
        table.add_column("\n".join(filter(None, (title, *params.split(",")))), justify="right", overflow="fold")
    marks = any(cell.bold for _, cells in grid.rows for cell in cells)
    for k, (facts, cells) in enumerate(grid.rows):
        shown = (f"{c.text}{('*' if c.bold else ' ') if marks else ''}" for c in cells)
        ends = k + 1 == len(grid.rows) or bool(grid.rows[k + 1][0][0])
        table.add_row(*map(Text, facts), *map(Text, shown), end_section=ends and not facts[0])
    return table


def _natural(table: RenderableType) -> int:
    """Columns that nothing is broken in."""
    wide = Console(width=UNBOUNDED)
    return Measurement.get(wide, wide.options, table).maximum


def _printed(pieces: Iterable[RenderableType], width: int, terminal: bool) -> str:
    """Text of the pieces; in a file a table is as wide as it needs, so that no name is broken in two."""
    console = Console(width=width, force_terminal=terminal, color_system="standard" if terminal else None)
    with console.capture() as capture:
        for piece in pieces:
            console.width = width if terminal or not isinstance(piece, Table) else max(width, _natural(piece))
            console.print(piece)
    return "\n".join(line.rstrip() for line in capture.get().splitlines()) + "\n"


def _block(scene: Scene, width: int, timed: bool) -> Iterator[RenderableType]:
    facts = [counted(scene.cameras, "camera")]
    if math.isfinite(scene.edges_percent):
        facts.append(f"{scene.edges_percent:.1f} % of edges")
    if math.isfinite(scene.hardness):
        facts.append(f"hardness {scene.hardness:.4f}")
    if (seeds := max(entry.seeds for entry in scene.entries)) > 1:
        facts.append(f"{seeds} seeds")
    rules = f"protocol {scene.protocol} · alignment {scene.alignment}"
    yield Text.assemble((f"{scene.dataset} / {scene.instance}", "bold underline"), f"  {rules}")
    yield Text(f"{' · '.join(facts)}{'' if scene.has_truth else NO_TRUTH}", style="dim")
    solved = [entry for entry in scene.entries if entry.ok]
    if solved:
        yield _table(scene, solved, width, timed)
    remarks = [(e.label, e.failure) for e in scene.entries if e.failures]
    remarks += [(e.label, note) for e in scene.entries for note in e.notes]
    if remarks:
        yield Padding(_remarks(remarks), (0, 0, 0, 2))
    yield Text()


def _table(scene: Scene, entries: Iterable[Entry], width: int, timed: bool) -> Table:
    entries = list(entries)
    several = any(entry.seeds > 1 for entry in entries)
    partial = any(entry.ok < entry.seeds for entry in entries)
    of = "" if scene.has_truth else "residual_"
    columns = [(f"{of}mean_deg", "mean °"), (f"{of}median_deg", "median °")]
    if timed:
        columns += [("solve_s", "median s"), ("min_s", "min s"), ("speedup", "times faster")]
    else:
        if scene.has_truth and width >= WIDE and not several:
            columns += [("p90_deg", "p90 °"), ("within_5_deg", "<5°"), ("within_10_deg", "<10°")]
        if scene.has_roc:
            columns.append(("roc_auc", "AUC"))
        columns += [("solve_s", "time s"), ("peak_mib", "MiB")]
    table = _empty_table()
    table.add_column("  method", overflow="fold", min_width=16)
    for _, title in columns:
        table.add_column(title, justify="right", no_wrap=True)
    if partial:
        table.add_column("seeds", justify="right", no_wrap=True)
    spelled = width >= WIDE and not several and not timed
    table.add_column("solved/scored/all" if spelled else "cameras", justify="right", no_wrap=True)
    for entry in entries:
        cells = [_cell(entry, name, timed) for name, _ in columns]
        if partial:
            cells.append(f"{entry.ok}/{entry.seeds}")
        cells.append(f"{entry.solved}/{entry.scored}/{scene.cameras}")
        marked = Text(f"{'*' if entry.best else ' '} {entry.label}")
        table.add_row(marked, *map(Text, cells), style="bold" if entry.best else "")
    return table


def _empty_table() -> Table:
    return Table(
        box=box.SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, 1),
        collapse_padding=True,
        header_style="dim",
    )


def _cell(entry: Entry, name: str, timed: bool) -> str:
    value = entry.value(name)
    if name == "speedup":
        return speedup(entry)
    if timed and name in ("solve_s", "min_s"):
        return exact_seconds(value.mean)
    if name.startswith("within"):
        return f"{100 * value.mean:.0f} %" if value.known else "–"
    if name == "solve_s":
        return seconds(value.mean)
    if name == "roc_auc":
        return area(value.mean)
    if name == "peak_mib":
        return f"{value.mean:.0f}" if value.known else "–"
    spread = f" ±{degrees(value.half_width)}" if math.isfinite(value.half_width) else ""
    return degrees(value.mean) + spread


def _remarks(remarks: Iterable[tuple[str, str]]) -> Table:
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 1))
    table.add_column(overflow="fold", min_width=16, max_width=36)
    table.add_column(overflow="fold", style="dim")
    for label, remark in remarks:
        table.add_row(Text(label), Text(remark))
    return table


def _legend(frame: pd.DataFrame) -> list[str]:
    rules = " and ".join(dict.fromkeys(map(str, frame["alignment"])))
    lines = [
        f"* {TIE_LEGEND}",
        f"errors in degrees over the scored cameras after {rules} alignment; {times_note(frame)}; "
        "cameras: solved / scored / all",
    ]
    if "hardness" in frame and frame["hardness"].notna().any():
        lines.append(HARDNESS_LEGEND)
    if frame["seed"].nunique() > 1:
        lines.append(SEEDS_LEGEND)
    if "roc_auc" in frame and frame["roc_auc"].notna().any():
        lines.append(f"AUC: {ROC_LEGEND}")
    return lines
