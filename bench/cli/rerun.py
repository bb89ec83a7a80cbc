"""``bench rerun``: one job again, from its record."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import DataDirOption, PluginOption

if TYPE_CHECKING:
    from bench.execution.single import Answer
    from bench.running.replay import Repetition
    from bench.storage.record import Report


def rerun(
    record: Annotated[Path, typer.Argument(metavar="RECORD", help="A file of RUN/records.")],
    data_dir: DataDirOption = None,
    plugin: PluginOption = None,
    pdb: Annotated[
        bool, typer.Option("--pdb", help="Run it in this process, without limits; the debugger opens where it raises.")
    ] = False,
) -> None:
    """Repeat the job of a record, with its instance, parameters, seed, limits and threads; nothing is stored.

    What has changed since (instance, source of the method, versions) is reported. The exit code is 1 when the job
    ends differently, or with an estimate that is not bit-identical to the one in the record's run.
    """
    from bench.running.replay import prepare

    ready = prepare(record, data_dir, plugin or [])
    job = ready.record.job
    typer.echo(f"{job.label} on {job.dataset} {job.instance}, seed {job.seed}")
    for sentence in ready.differences or ("instance, source and versions are as they were",):
        typer.echo(sentence)
    answer = _debugged(ready) if pdb else ready.supervised()
    typer.echo(f"then: {ready.record.outcome.text}{_seconds(ready.record.report)}")
    typer.echo(f"now:  {answer.outcome.text}{_seconds(answer.report)}")
    if sentence := ready.compared(answer.estimate):
        typer.echo(sentence)
    raise typer.Exit(0 if ready.same(answer.outcome, answer.estimate) else 1)


def _debugged(ready: "Repetition") -> "Answer":
    import pdb
    import traceback

    from bench.core import outcome
    from bench.core.outcome import Outcome
    from bench.execution.single import Answer
    from bench.storage.record import Report

    try:
        return ready.in_this_process()
    except Exception as error:
        typer.echo(traceback.format_exc())
        pdb.post_mortem(error.__traceback__)
        return Answer(Outcome(outcome.ERROR, f"{type(error).__name__}: {error}"), Report(), None)


def _seconds(report: "Report") -> str:
    return f", {report.solve_s:.3g} s" if report.solve_s is not None else ""
