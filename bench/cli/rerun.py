"""``bench rerun``: one job again, from its record."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bench.cli.options import DataDirOption, PluginOption

if TYPE_CHECKING:
    from bench.execution.single import Answer
    from bench.running.replay import Repetition


def rerun(
    record: Annotated[Path, typer.Argument(metavar="RECORD", help="A file of RUN/records.")],
    data_dir: DataDirOption = None,
    plugin: PluginOption = None,
    pdb: Annotated[
        bool, typer.Option("--pdb", help="Run it in this process, without limits; the debugger opens where it raises.")
    ] = False,
) -> None:
    """Repeat the job of a record, with its instance, parameters, seed, limits and threads; nothing is stored.

    What is no longer as it was (instance, source of the method, versions) is said. The exit code is 1 when the job
    ends differently, or with an estimate that is not bit-identical to the one in the record's run.
    """
    from bench.plugins.selection import format_selection
    from bench.running.replay import prepare

    ready = prepare(record, data_dir, plugin or [])
    job = ready.job
    method = format_selection(job.method, job.parameters)
    typer.echo(f"{method} on {job.dataset} {job.instance}, seed {job.seed}")
    for sentence in ready.differences or ("instance, source and versions are as they were",):
        typer.echo(sentence)
    ended, report, estimate = _debugged(ready) if pdb else ready.supervised()
    typer.echo(f"then: {ready.record['status']}{_seconds(ready.record)}")
    typer.echo(f"now:  {ended.text}{_seconds(report)}")
    if sentence := ready.compared(estimate):
        typer.echo(sentence)
    raise typer.Exit(0 if ready.same(ended, estimate) else 1)


def _debugged(ready: "Repetition") -> "Answer":
    import pdb
    import traceback

    from bench.core import outcome
    from bench.core.outcome import Outcome

    try:
        return ready.in_this_process()
    except Exception as error:
        typer.echo(traceback.format_exc())
        pdb.post_mortem(error.__traceback__)
        return Outcome(outcome.ERROR, f"{type(error).__name__}: {error}"), {}, None


def _seconds(report: Mapping[str, Any]) -> str:
    return f", {report['solve_s']:.3g} s" if "solve_s" in report else ""
