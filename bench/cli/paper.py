"""``bench paper``: a table or figure of a paper, made again and compared."""

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import Align, DataDirOption, Format, StyleOption, wear
from bench.running.progress.live import execute

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.figure import Figure

    from bench.papers.computed import Computed
    from bench.papers.layout import Item, Layout
    from bench.reporting.tables.grid import Grid
    from bench.running.run import Options, Run
    from bench.suite.experiment import Suite


def paper(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="See `list papers`; or a TOML file of your own.")],
    item: Annotated[str, typer.Argument(metavar="ITEM", help="Table or figure, such as table1.")],
    data_dir: DataDirOption = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the run.  [default: results/runs/PAPER]")
    ] = None,
    explain: Annotated[
        list[str] | None,
        typer.Option("--explain", metavar="CELL", help="Which single switch closes the gap of SCENE/COLUMN? Repeats."),
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

    With --explain, alignment, protocol, statistic, angle and method are toggled one at a time instead, and the one
    that moves our number closest to the published one is named.
    """
    from bench.papers.items.curves import CurvePlot
    from bench.papers.items.properties import PropertyTable
    from bench.papers.layout import load_layout
    from bench.papers.tables import paper as tables
    from bench.running.run import RUNS_FOLDER, Options

    wear(style)
    layout = load_layout(paper)
    chosen = layout.item(item)
    folder = out or RUNS_FOLDER / layout.name
    options = Options(out=folder, data_dir=data_dir, seeds=seeds, jobs=jobs)
    if explain:
        _explain(chosen, layout, explain, options, align, format)
        return
    if isinstance(chosen, PropertyTable):
        frame = chosen.compare()
        _print(tables.property_grid(chosen, frame), frame, format)
        return
    rule = align.value if align else chosen.alignment
    computed = _computed(chosen, layout.name, options, rule)
    grid, frame = _compared(chosen, layout, computed, rule, format)
    _print(grid, frame, format)
    if isinstance(chosen, CurvePlot):
        from bench.papers.bands import draw

        _save(draw(chosen, frame, rule, grid.notes), frame, folder / "plots", item)


def _compared(
    item: "Item", layout: "Layout", computed: "Computed", rule: str, format: Format
) -> "tuple[Grid, pd.DataFrame]":
    """The table of an item, and the data frame behind it."""
    from bench.papers.items.claims import Claims
    from bench.papers.items.curves import CurvePlot
    from bench.papers.items.scenes import SceneTable
    from bench.papers.items.speedup import Speedup
    from bench.papers.published import read_published
    from bench.papers.tables import claims, paper
    from bench.papers.tables.side_by_side import side_by_side

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
    from bench.papers.computed import Computed
    from bench.papers.items.claims import Claims
    from bench.papers.items.speedup import Speedup
    from bench.scoring.results import score

    runs, missing = _run(item.suites(name), name, options)
    if not runs:
        return Computed(missing=tuple(missing))
    store = runs[0].store
    jobs = [cell.job for planned in runs for cell in planned.cells]
    notes = {job.instance: store.instance(key).notes for key, job in {job.instance_key: job for job in jobs}.items()}
    scores = score(store, rule, jobs=jobs, oracle=isinstance(item, Claims), checkpoints=isinstance(item, Speedup))
    return Computed(jobs, scores, notes, tuple(missing), lambda job: store.instance(job.instance_key))


def _run(suites: "Sequence[Suite]", name: str, options: "Options") -> "tuple[list[Run], list[str]]":
    """Run what is not done; the runs, and a sentence for what is not on disk."""
    from bench.running.run import NothingToRunError, Run

    missing: list[str] = []
    runs = []
    for suite in suites:
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
    return runs, missing


def _explain(
    item: "Item",
    layout: "Layout",
    names: list[str],
    options: "Options",
    align: Align | None,
    format: Format,
) -> None:
    """Print which switch closes the gap of each cell."""
    from bench.core.errors import InputError
    from bench.papers.explain import cells, explain_cell, suites_of, together
    from bench.papers.items.scenes import SceneTable
    from bench.papers.published import SCENE, read_published
    from bench.papers.tables.explained import explained_grid

    if not isinstance(item, SceneTable):
        raise InputError("--explain takes a table of scenes, such as table1")
    published = read_published(layout.folder, item.published)
    item.check(published)
    rule = align.value if align else item.alignment
    done = []
    for scene, column in dict.fromkeys(cell for name in names for cell in cells(name, item, published)):
        runs, missing = _run(suites_of(item, scene, column, layout.name), layout.name, options)
        if not runs:
            raise InputError(f"--explain '{scene}': {'; '.join(missing)}")
        jobs = [planned_cell.job for planned in runs for planned_cell in planned.cells]
        printed = next(row[column] for row in published if row[SCENE] == scene)
        done.append(explain_cell(item, scene, column, printed, rule, jobs, runs[0].store))
        _print(explained_grid(done[-1], rule), done[-1].rows, format)
    for sentence in together(done):
        typer.echo(sentence, err=format is not Format.CONSOLE)


def _print(grid: "Grid", frame: "pd.DataFrame", format: Format) -> None:
    from bench.papers.tables.paper import render

    width = shutil.get_terminal_size((120, 24)).columns
    text, notes = render(grid, frame, format.value, width=width, terminal=sys.stdout.isatty())
    typer.echo(text, nl=not text.endswith("\n"))
    for note in notes:
        typer.echo(note, err=True)


def _save(figure: "Figure", points: "pd.DataFrame", folder: Path, name: str) -> None:
    from bench.reporting.figures.style import save

    paths = save(figure, folder, name)
    paths.append(folder / f"{name}.csv")
    points.to_csv(paths[-1], index=False)
    for path in paths:
        typer.echo(path, err=True)
