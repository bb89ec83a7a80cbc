"""``bench paper``: a table or figure of a paper, made again and compared."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import Align, DataDirOption, Format, StyleOption, console, show, wear
from bench.running.progress.live import execute

if TYPE_CHECKING:
    from bench.papers.item import Comparison
    from bench.running.run import Run


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
    from bench.papers.explain.cells import explanations
    from bench.papers.explain.switches import together
    from bench.papers.layout import load_layout
    from bench.papers.make import make
    from bench.running.run import RUNS_FOLDER, Options

    wear(style)
    layout = load_layout(paper)
    chosen = layout.item(item)
    folder = out or RUNS_FOLDER / layout.name
    options = Options(out=folder, data_dir=data_dir, seeds=seeds, jobs=jobs)
    rule = align.value if align else None
    if not explain:
        made = make(layout, chosen, options, rule, _run)
        show(made.text(format.value, **console()))
        _save(made, folder / "plots", item)
        return
    done = []
    for found in explanations(layout, chosen, explain, options, rule, _run):
        show(found.text(format.value, **console()))
        done.append(found)
    for sentence in together(done):
        typer.echo(sentence, err=format is not Format.CONSOLE)


def _run(planned: "Run") -> None:
    done = len(planned.cells) - len(planned.todo)
    where = f"{len(planned.cells)} jobs, {done} of them done already -> {planned.store.folder}"
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
