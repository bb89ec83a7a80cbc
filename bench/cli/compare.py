"""``bench compare``: one run against another; the exit code says whether anything is worse."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import Align, AlignOption, Format, ProtocolOption, console, run_folder, show

if TYPE_CHECKING:
    from bench.scoring.results import Results
    from bench.storage.store import Store


def compare(
    first: Annotated[Path, typer.Argument(metavar="RUN_A", help="The run that is compared with, folder or name.")],
    second: Annotated[Path, typer.Argument(metavar="RUN_B", help="The run that is judged.")],
    align: AlignOption = Align.L1,
    protocol: ProtocolOption = None,
    threshold: Annotated[
        float, typer.Option(metavar="RATIO", help="A change by less than this ratio is no regression.")
    ] = 1.05,
    format: Format = Format.CONSOLE,
) -> None:
    """Say what became better or worse from RUN_A to RUN_B, on the problems, methods and seeds that both have.

    Exit code 0: nothing is worse; 1: a method's error or time is, or a job no longer ends well; 2: bad input.
    """
    from bench.core.errors import InputError
    from bench.reporting.tables.compared import comparison_grid, comparison_table, verdict
    from bench.reporting.tables.render import text_of
    from bench.scoring.comparison import compare as compared
    from bench.scoring.results import score
    from bench.storage.store import Store

    if not threshold >= 1:
        raise InputError(f"--threshold is a ratio of at least 1, such as 1.05, not {threshold:g}")
    stores = [Store.open(run_folder(run)) for run in (first, second)]
    old, new = (score(store, align.value, protocol) for store in stores)
    found = compared(old, new, threshold, no_times=_why_no_times(stores, [old, new]))
    grid = comparison_grid(found, align.value, threshold)
    show(text_of(grid, comparison_table(found), format.value, **console()))
    typer.echo(verdict(found), err=format is Format.CSV)
    raise typer.Exit(1 if found.regressed else 0)


def _why_no_times(stores: "list[Store]", results: "list[Results]") -> str:
    """Why the times of two runs are not comparable; "" where they are."""
    if not all("round_s" in scored.frame for scored in results):
        return "both have to be timing runs (run --timing)"
    machines = [
        {
            (record.provenance.get("cpu"), record.limits.threads)
            for job in scored.frame["job"]
            if (record := store.record(job))
        }
        for store, scored in zip(stores, results, strict=True)
    ]
    return "" if machines[0] == machines[1] else "the runs are from different processors or with other threads"
