"""``bench paper``: a table or figure of a paper, made again and compared."""

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import Align, DataDirOption, Format, StyleOption, wear
from bench.cli.progress import execute

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from bench.papers.computed import Computed
    from bench.papers.layout import Item, Layout
    from bench.reporting.grid import Grid
    from bench.runner import Options


def paper(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="See `list papers`; or a TOML file of your own.")],
    item: Annotated[str, typer.Argument(metavar="ITEM", help="Table or figure, such as table1.")],
    data_dir: DataDirOption = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the run.  [default: results/runs/PAPER]")
    ] = None,
    align: Annotated[
        Align | None, typer.Option(help="Rule that removes the gauge; re-scores.  [default: the paper's]")
    ] = None,
    seeds: Annotated[int | None, typer.Option(metavar="N", help="Seeds 0 to N-1 of what is computed.")] = None,
    jobs: Annotated[int | None, typer.Option(metavar="N", help="Jobs at a time.  [default: one a core]")] = None,
    format: Format = Format.CONSOLE,
    style: StyleOption = None,
) -> None:
    """Run what is not done, then print measured | published | difference; a figure is drawn too.

    The table goes to standard output, everything else to standard error.
    """
    from bench.papers.curves import CurvePlot
    from bench.papers.layout import load_layout
    from bench.papers.properties import PropertyTable
    from bench.reporting import paper as tables
    from bench.runner import RUNS_FOLDER, Options

    wear(style)
    layout = load_layout(paper)
    chosen = layout.item(item)
    if isinstance(chosen, PropertyTable):
        frame = chosen.compare()
        _print(tables.property_grid(chosen, frame), frame, format)
        return
    folder = out or RUNS_FOLDER / layout.name
    options = Options(out=folder, data_dir=data_dir, seeds=seeds, jobs=jobs)
    rule = align.value if align else chosen.alignment
    computed = _computed(chosen, layout.name, options, rule)
    grid, frame = _compared(chosen, layout, computed, rule, format)
    _print(grid, frame, format)
    if isinstance(chosen, CurvePlot):
        from bench.reporting.bands import draw

        _save(draw(chosen, frame, rule, grid.notes), frame, folder / "plots", item)


def _compared(
    item: "Item", layout: "Layout", computed: "Computed", rule: str, format: Format
) -> "tuple[Grid, pd.DataFrame]":
    """The table of an item, and the data frame behind it."""
    from bench.papers.claims import Claims
    from bench.papers.curves import CurvePlot
    from bench.papers.published import read_published
    from bench.papers.scenes import SceneTable
    from bench.papers.speedup import Speedup
    from bench.reporting import claims, paper
    from bench.reporting.side_by_side import side_by_side

    if isinstance(item, SceneTable):
        frame = item.compare(read_published(layout.folder, item.published), computed)
        draw = side_by_side if format is Format.LATEX else paper.scene_grid
        return draw(item, frame, computed, rule), frame
    if isinstance(item, Claims):
        frame = item.compare(read_published(layout.folder, item.published), computed)
        return claims.claims_grid(item, frame, computed, rule), frame
    if isinstance(item, Speedup):
        frame = item.compare(layout.reference, computed)
        return claims.speedup_grid(item, frame, computed, rule), frame
    assert isinstance(item, CurvePlot)
    frame = item.points(computed)
    return paper.point_grid(item, frame, rule, paper.point_notes(item, frame, computed)), frame


def _computed(item: "Item", name: str, options: "Options", rule: str) -> "Computed":
    """Run what is not done, then score the jobs of the item."""
    from bench.papers.claims import Claims
    from bench.papers.computed import Computed
    from bench.papers.speedup import Speedup
    from bench.results import score
    from bench.runner import NothingToRunError, Run

    missing: list[str] = []
    runs = []
    for suite in item.suites(name):
        try:
            planned = Run(suite, options=options)
        except NothingToRunError as nothing:
            missing += nothing.missing
            continue
        done = len(planned.cells) - len(planned.todo)
        where = f"{len(planned.cells)} jobs, {done} of them done already -> {planned.store.folder}"
        typer.echo(f"{name}: {where}", err=True)
        planned.prepare(lambda text: typer.echo(text, err=True))
        execute(planned, stderr=True)
        missing += planned.experiment.missing
        runs.append(planned)
    if not runs:
        return Computed(missing=tuple(missing))
    store = runs[0].store
    jobs = [cell.job for planned in runs for cell in planned.cells]
    notes = {job.instance: store.instance(key).notes for key, job in {job.instance_key: job for job in jobs}.items()}
    scores = score(store, rule, jobs=jobs, oracle=isinstance(item, Claims), checkpoints=isinstance(item, Speedup))
    return Computed(jobs, scores, notes, tuple(missing), lambda job: store.instance(job.instance_key))


def _print(grid: "Grid", frame: "pd.DataFrame", format: Format) -> None:
    from bench.reporting.paper import render

    width = shutil.get_terminal_size((120, 24)).columns
    text, notes = render(grid, frame, format.value, width=width, terminal=sys.stdout.isatty())
    typer.echo(text, nl=not text.endswith("\n"))
    for note in notes:
        typer.echo(note, err=True)


def _save(figure: "Figure", points: "pd.DataFrame", folder: Path, name: str) -> None:
    from bench.reporting.style import save

    paths = save(figure, folder, name)
    paths.append(folder / f"{name}.csv")
    points.to_csv(paths[-1], index=False)
    for path in paths:
        typer.echo(path, err=True)
