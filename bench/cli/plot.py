"""``bench plot``: score a run again and draw its plots."""

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import Align, AlignOption, ProtocolOption, RunFolder, StyleOption, run_folder, wear


def plot(
    run: RunFolder,
    align: AlignOption = Align.L1,
    protocol: ProtocolOption = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for the plots.  [default: RUN/plots]")] = None,
    style: StyleOption = None,
    width: Annotated[
        str | None,
        typer.Option(metavar="W", help="Figures for a paper: single (3.5 in), double (7.16 in) or inches."),
    ] = None,
) -> None:
    """Draw every figure that a run has data for as PNG, PDF and SVG.

    Error per scene, cumulative errors, error against time; with two problems or more rank probabilities, the critical
    difference and performance profiles too. With --width, title and caption are not drawn but written to
    captions.tex.
    """
    from bench.reporting.present import write_plots
    from bench.scoring.results import score
    from bench.storage.store import Store

    wear(style, width)
    folder = run_folder(run)
    results = score(Store.open(folder), align.value, protocol, checkpoints=True)
    for path in write_plots(results, out or folder / "plots"):
        typer.echo(path)
