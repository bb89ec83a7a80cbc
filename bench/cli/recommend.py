"""``bench recommend``: which method for this graph."""

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import DataDirOption, PluginOption, console


def recommend(
    graph: Annotated[
        str,
        typer.Argument(metavar="GRAPH", help="A file or folder (see `data formats`), or a selection of a dataset."),
    ],
    budget: Annotated[
        float, typer.Option(metavar="SECONDS", help="For the candidates on the twins, once they are compiled.")
    ] = 60.0,
    method: Annotated[
        list[str] | None,
        typer.Option(
            "--method", "-m", metavar="M", help="A candidate in place of the suite's; twins decide.  Repeatable."
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Keep the run on the twins, for `table`.")] = None,
    jobs: Annotated[int | None, typer.Option(metavar="N", help="Jobs at a time.  [default: one a core]")] = None,
    data_dir: DataDirOption = None,
    plugin: PluginOption = None,
) -> None:
    """Recommend a method for a graph, with the error to expect and what would change the answer.

    The graph is simulated with a truth: the same cameras and edges, with errors by whose size triangles close as badly
    as those measured (dataset twin). The candidates (suite recommend) solve these twins, and the quickest of those
    that do as well as the best is recommended. Where the graph shows that its twins cannot be trusted, results on other
    real graphs decide instead, and this is said.

    Example: graph.g2o --budget 30
    """
    import os
    from dataclasses import replace

    from bench.advice.recommendation import recommend as recommended
    from bench.advice.words import answer, command, seen_in, twins_grid
    from bench.reporting.tables.console import render_grid
    from bench.running.run import Options
    from bench.scoring.doubts import doubts

    options = Options(out=out, jobs=jobs, data_dir=data_dir, plugins=tuple(plugin or ()))
    found = recommended(graph, options, method or (), budget, lambda line: typer.echo(line, err=True))
    typer.echo(f"{graph}:")
    for line in seen_in(found.look):
        typer.echo(f"  {line}")
    for note in doubts(replace(found.instance, truth=None)):
        typer.echo(f"  note: {note}")
    typer.echo(f"\n{render_grid(twins_grid(found), **console())}")
    for paragraph in filter(None, answer(found)):
        typer.echo(f"{paragraph}\n")
    typer.echo(command(graph, found.method, os.path.exists(graph)))
