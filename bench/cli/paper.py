"""``bench paper``: a table or figure of a paper, made again and compared."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import Align, DataDirOption, Format, PluginOption, StyleOption, console, show, wear
from bench.core.words import counted
from bench.running.progress.live import execute, foreseen

if TYPE_CHECKING:
    from bench.papers.item import Comparison, Item
    from bench.papers.layout import Layout
    from bench.papers.make import Planned
    from bench.running.run import Options, Run


def paper(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="See `list papers`; or a TOML file of your own.")],
    item: Annotated[str, typer.Argument(metavar="ITEM", help="Table or figure, such as table1.")],
    data_dir: DataDirOption = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the run.  [default: results/runs/PAPER]")
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option("--method", "-m", metavar="M", help="A method of yours beside the paper's. Repeatable."),
    ] = None,
    plugin: PluginOption = None,
    explain: Annotated[
        list[str] | None,
        typer.Option(
            "--explain", metavar="CELL", help="Which single switch closes the gap of SCENE/COLUMN? Repeatable."
        ),
    ] = None,
    align: Annotated[
        Align | None, typer.Option(help="Rule that removes the gauge; re-scores.  [default: the paper's]")
    ] = None,
    seeds: Annotated[int | None, typer.Option(metavar="N", help="Seeds 0 to N-1 of what is computed.")] = None,
    jobs: Annotated[int | None, typer.Option(metavar="N", help="Jobs at a time.  [default: one a core]")] = None,
    compute: Annotated[bool, typer.Option("--compute", help="Also compute what takes hours and is recorded.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would run, and run nothing.")] = False,
    format: Format = Format.CONSOLE,
    style: StyleOption = None,
) -> None:
    """Run what is not done, then print measured | published | difference; a figure is drawn too.

    Everything is checked before the first job. The table goes to standard output, everything else to standard error.

    What takes hours and is recorded is shown as it was recorded, and labelled so, unless --compute, --seeds or --align
    asks for more, or all of it is done in the folder of the run.

    With --explain, alignment, protocol, statistic, angle and method are toggled one at a time instead, and the one
    that moves our number closest to the published one is named.

    Example: dmf-synch-2023 table1 -m mine --plugin mine.py --data-dir DIR
    """
    from bench.core.errors import InputError
    from bench.papers.layout import load_layout
    from bench.papers.make import compared, plan, with_methods
    from bench.running.run import RUNS_FOLDER, NothingToRunError, Options

    wear(style)
    layout = load_layout(paper)
    folder = out or RUNS_FOLDER / layout.name
    options = Options(out=folder, data_dir=data_dir, seeds=seeds, jobs=jobs, plugins=tuple(plugin or ()))
    rule = align.value if align else None
    if explain:
        if method or plugin:
            raise InputError("--explain is about what the layout measures: leave out -m and --plugin")
        _explain(layout, layout.item(item), explain, options, rule, format, dry_run)
        return
    chosen = with_methods(layout.item(item), method or (), options)
    chosen.verify(layout.sources)
    planned = plan(chosen.suites(layout.name), options)
    if planned.missing and not planned.runs and (method or plugin):
        raise NothingToRunError(planned.missing)
    if dry_run:
        _foresee([planned])
        return
    recorded = None if compute or seeds or align or not planned.todo else chosen.read_recorded(layout.sources)
    if recorded:
        _say_cost(planned)
        show(recorded.text(format.value, **console()))
        return
    for sentence in planned.missing:
        typer.echo(f"missing: {sentence}", err=True)
    _say_time(planned)
    made = compared(layout, chosen, rule, planned.execute(_run), options)
    show(made.text(format.value, **console()))
    _save(made, folder / "plots", item)


def _explain(
    layout: "Layout",
    item: "Item",
    names: list[str],
    options: "Options",
    rule: str | None,
    format: Format,
    dry_run: bool,
) -> None:
    from bench.papers.explain.cells import explanations, plans
    from bench.papers.explain.switches import together

    planned = plans(layout, item, names, options)
    if dry_run:
        _foresee(list(planned.values()))
        return
    done = []
    for found in explanations(layout, item, planned, rule, _run):
        show(found.text(format.value, **console()))
        done.append(found)
    for sentence in together(done):
        typer.echo(sentence, err=format is not Format.CONSOLE)


def _foresee(planned: "list[Planned]") -> None:
    """What would run, and how long it would take."""
    runs = [run for part in planned for run in part.runs]
    todo = {cell.job.id for run in runs for cell in run.todo}
    for cell in {cell.job.id: cell for run in runs for cell in run.cells}.values():
        job = cell.job
        state = "to run" if job.id in todo else "done"
        typer.echo(f"{state:<7} {job.dataset} {job.instance} seed {job.seed} {job.label}")
    for sentence in dict.fromkeys(sentence for part in planned for sentence in part.missing):
        typer.echo(f"missing: {sentence}")
    if todo:
        typer.echo(foreseen(*runs))
    elif not runs:
        typer.echo("nothing has to run")


def _say_cost(planned: "Planned") -> None:
    typer.echo(
        f"recorded results; --compute computes them here: {counted(planned.jobs, 'job')}, {planned.todo} to run; "
        f"{foreseen(*planned.runs)}",
        err=True,
    )


def _say_time(planned: "Planned") -> None:
    """How long all of it will take, before it begins."""
    if planned.todo:
        typer.echo(f"{counted(planned.todo, 'job')} to run; {foreseen(*planned.runs)}", err=True)


def _run(planned: "Run") -> None:
    done = len(planned.cells) - len(planned.todo)
    where = f"{counted(len(planned.cells), 'job')}, {done} of them done already -> {planned.store.folder}"
    typer.echo(f"{planned.experiment.suite.name}: {where}", err=True)
    planned.prepare(lambda text: typer.echo(text, err=True))
    execute(planned, stderr=True)


def _save(made: "Comparison", folder: Path, name: str) -> None:
    from bench.reporting.figures.style import save

    if (figure := made.figure()) is None:
        return
    paths = [*save(figure, folder, name), folder / f"{name}.csv"]
    made.frame().to_csv(paths[-1], index=False)
    for path in paths:
        typer.echo(path, err=True)
