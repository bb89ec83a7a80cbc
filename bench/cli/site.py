"""``bench site``: static pages of results that are kept."""

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import Align, AlignOption, run_folder


def site(
    results: Annotated[
        list[Path],
        typer.Argument(metavar="RESULTS...", help="Runs, and folders of committed results such as results/reference."),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the site, replaced.")] = Path("site"),
    title: Annotated[
        str, typer.Option(metavar="TEXT", help="Title of the leaderboard.")
    ] = "Rotation synchronization: leaderboard",
    align: AlignOption = Align.L1,
) -> None:
    """Write a leaderboard as a folder of pages: suites, filters, history by version, a page for each method.

    Every number leads to the command that made it. The pages load nothing from the network: open them from disk, or
    put the folder on any web server.
    """
    from bench.site.committed import read_all
    from bench.site.pages import write_site

    typer.echo(write_site(read_all([run_folder(path) for path in results], align.value), out, title))
