"""``bench plot``: score a run again and draw its plots."""

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import Align, AlignOption, ProtocolOption, RunFolder, run_folder


def plot(
    run: RunFolder,
    align: AlignOption = Align.L1,
    protocol: ProtocolOption = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for the plots.  [default: RUN/plots]")] = None,
) -> None:
    """Draw error per scene, cumulative errors and error against time as PNG, PDF and SVG."""
    from bench.reporting.present import write_plots
    from bench.results import score
    from bench.store import Store

    folder = run_folder(run)
    results = score(Store.open(folder), align.value, protocol.value if protocol else None, checkpoints=True)
    for path in write_plots(results, out or folder / "plots"):
        typer.echo(path)
