"""``bench merge``: bring folders of a run, filled on different machines, together."""

from pathlib import Path
from typing import Annotated

import typer


def merge(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Folders of runs; they stay as they are.")],
    into: Annotated[Path, typer.Option("--into", metavar="DIR", help="Folder that gets everything; new or a run.")],
) -> None:
    """Merge runs: nothing finished is lost, and what several have is kept once.

    What cannot be read is named and left out; the command that made the run then runs it again.
    """
    from bench.cli.options import run_folder
    from bench.storage.merge import merge as merged_into

    done = merged_into([run_folder(run) for run in runs], into)
    for sentence in done.told:
        typer.echo(sentence, err=True)
    typer.echo(f"{into}: {done.added} records added, {done.replaced} replaced by better ones, {done.kept} kept")
