"""``bench calibrate``: are simulated graphs like the real ones of the same run?"""

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import Align, AlignOption, Format, ProtocolOption, RunFolder, console, run_folder, show


def calibrate(
    run: RunFolder,
    align: AlignOption = Align.L1,
    protocol: ProtocolOption = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the tables and the figure as files.")
    ] = None,
    format: Format = Format.CONSOLE,
) -> None:
    """Compare the simulated graphs of RUN with its real ones: errors, triangles, and how methods rank.

    Simulated graphs are those whose outliers are known. Each is compared with the real graph whose name
    its own begins with; a dataset without such names is compared as a whole with every real graph.

    Example: run -d '1dsfm[scene=Ellis_Island]' -d "twin[of='1dsfm[scene=Ellis_Island]']" -m ... --out RUN, then this.
    """
    from bench.reporting.present import write_calibration
    from bench.reporting.tables.calibrated import calibration_grid, verdicts
    from bench.reporting.tables.render import text_of
    from bench.scoring.calibration.agreement import calibrate as calibrated
    from bench.scoring.results import score
    from bench.storage.store import Store

    store = Store.open(run_folder(run))
    found = calibrated(store, score(store, align.value, protocol))
    show(text_of([calibration_grid(found)], found.rows, format.value, **console()))
    for line in verdicts(found):
        typer.echo(line, err=format is Format.CSV)
    for path in write_calibration(found, out) if out else ():
        typer.echo(path, err=True)
