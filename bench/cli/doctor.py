"""``bench doctor``: what is damaged, missing or left over in the folder of a run."""

from typing import Annotated

import typer

from bench.cli.options import RunFolder, run_folder
from bench.core.words import counted


def doctor(
    run: RunFolder,
    repair: Annotated[
        bool, typer.Option("--repair", help="Move what is damaged to RUN/damaged, and remove what is of no use.")
    ] = False,
) -> None:
    """Examine the folder of a run; exit code 1 where something was found and is not repaired.

    After --repair, the command that made the run redoes what was damaged.
    """
    from bench.core import outcome
    from bench.core.program import program
    from bench.storage import doctor as doctors
    from bench.storage.store import ASIDE, Store

    folder = run_folder(run)
    findings = doctors.examine(folder)
    for finding in findings:
        typer.echo(f"{finding.path}: {finding.what}")
    if findings and repair:
        doctors.repair(folder, findings)
        typer.echo(f"{len(findings)} findings, repaired; what was damaged is in {folder / ASIDE}")
    elif findings:
        typer.echo(f"{len(findings)} findings; mend them with: {program()} doctor {folder} --repair")
        raise typer.Exit(1)
    store = Store.open(folder)
    jobs = store.jobs()
    ends = [record.outcome.kind if (record := store.record(job.id)) else outcome.NOT_RUN for job in jobs]
    counts = ", ".join(f"{ends.count(end)} {end}" for end in dict.fromkeys(ends))
    typer.echo(f"{folder}: {counted(len(jobs), 'job')} planned ({counts})")
