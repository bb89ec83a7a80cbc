"""``bench export``: what a repository keeps of a run."""

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import Align, AlignOption, ProtocolOption, RunFolder, run_folder


def export(
    run: RunFolder,
    into: Annotated[
        Path, typer.Option("--into", metavar="DIR", help="Folder of the results, such as results/reference/NAME.")
    ],
    title: Annotated[str, typer.Option(metavar="TEXT", help="What was compared.  [default: the suite]")] = "",
    align: AlignOption = Align.L1,
    protocol: ProtocolOption = None,
) -> None:
    """Write the scores of a run, where they come from and its records: what `site` reads and a pull request adds.

    Estimates, instances and the name of the machine are left out.
    """
    from bench.scoring.results import score
    from bench.site.export import export as exported
    from bench.storage.store import Store

    store = Store.open(run_folder(run))
    for path in exported(store, score(store, align.value, protocol), into, title):
        typer.echo(path)
