"""``bench report``: score a run again and write its HTML report."""

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import Align, AlignOption, ProtocolOption, RunFolder, StyleOption, run_folder, wear


def report(
    run: RunFolder,
    align: AlignOption = Align.L1,
    protocol: ProtocolOption = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="The file.  [default: RUN/report.html]")] = None,
    style: StyleOption = None,
) -> None:
    """Write one HTML file with findings in words, a leaderboard, figures, failures and the origin of the numbers.

    The file needs no network: open it from disk, send it, print it. The report is about one alignment rule; the
    leaderboard has all of them, and the report says whether the choice changes the ranking.
    """
    from bench.reporting.html.page import FILE_NAME, write_report
    from bench.scoring.results import score, under_every_rule
    from bench.storage.store import Store

    wear(style)
    folder = run_folder(run)
    store = Store.open(folder)
    results = score(store, align.value, protocol, checkpoints=True)
    typer.echo(write_report(store, under_every_rule(store, results), out or folder / FILE_NAME))
