"""Running what is to do, with progress."""

from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from bench.runner import Run


def execute(planned: "Run", *, stderr: bool = False) -> None:
    """Run what is to do, one line a job, with a progress bar and an ETA where there is a terminal.

    Ctrl-C ends the command with exit code 130; what is done is kept.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from bench.selection import format_selection

    console = Console(highlight=False, soft_wrap=True, stderr=stderr)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("ETA"),
        TimeRemainingColumn(),
    )
    try:
        with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as progress:
            task = progress.add_task("jobs", total=len(planned.todo))
            for count, (cell, record) in enumerate(planned.execute(), start=1):
                progress.advance(task)
                job = cell.job
                seconds = f"{record['solve_s']:.2f} s" if "solve_s" in record else ""
                method = format_selection(job.method, job.parameters)
                line = f"{count:>4}/{len(planned.todo)}  {job.instance:<24} {method:<32} {seconds:>10}  "
                console.print(f"{line}{record['status']}", markup=False)
    except KeyboardInterrupt:
        typer.echo(
            f"\ninterrupted; what is done is kept in {planned.store.folder}, and the same command continues",
            err=True,
        )
        raise typer.Exit(130) from None
