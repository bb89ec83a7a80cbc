"""``bench table``: score a run again and print its table."""

from typing import Annotated

import typer

from bench.cli.options import (
    Align,
    AlignOption,
    By,
    Format,
    ProtocolOption,
    RunFolder,
    StyleOption,
    console,
    run_folder,
    show,
    tables_of,
    wear,
)


def table(
    run: RunFolder,
    align: AlignOption = Align.L1,
    protocol: ProtocolOption = None,
    oracle: Annotated[
        bool, typer.Option("--oracle", help="Add the checkpoint that ground truth likes best, labelled so.")
    ] = False,
    by: Annotated[
        By | None,
        typer.Option(
            help="A table of every scene, or of means over collections.  [default: collection, where one has several]"
        ),
    ] = None,
    format: Format = Format.CONSOLE,
    style: StyleOption = None,
) -> None:
    """Print the table of a run; nothing is run. Notes go to standard error."""
    from bench.reporting.present import render_table
    from bench.scoring.results import score
    from bench.storage.store import Store

    wear(style)
    results = score(Store.open(run_folder(run)), align.value, protocol, oracle=oracle)
    show(render_table(results, format.value, by=tables_of(by), **console()))
