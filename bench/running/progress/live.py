"""Running what is to do, with progress."""

import os
from collections import Counter
from typing import TYPE_CHECKING

import typer

from bench.core.words import counted

if TYPE_CHECKING:
    from rich.console import Console

    from bench.running.engines.local import Finished
    from bench.running.run import Run

REFRESHES = 4  # a second
MOST_LINES = 20  # that are printed above the table at once


def execute(planned: "Run", *, stderr: bool = False) -> None:
    """Run what is to do: a live table where there is a terminal, else one line a job.

    Ctrl-C ends the command with exit code 130; what is done is kept.
    """
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=True, stderr=stderr)
    try:
        (_live if console.is_interactive and planned.todo else _plain)(planned, console)
    except KeyboardInterrupt:
        typer.echo(
            f"\ninterrupted; what is done is kept in {planned.store.folder}, and the same command continues",
            err=True,
        )
        raise typer.Exit(130) from None


def workers_of(planned: "Run") -> int:
    """How many jobs run at a time."""
    return 1 if planned.options.timing else planned.options.jobs or os.cpu_count() or 1


def foreseen(planned: "Run", *further: "Run") -> str:
    """How long a run will take, and others after it in the same folder, going by earlier records, in a sentence."""
    from bench.running.progress.pace import remaining_s, span
    from bench.running.progress.past import Past

    past = Past(planned, *further)
    tasks = [past.task(cell.job) for run in (planned, *further) for cell in run.todo]
    workers = workers_of(planned)
    left = remaining_s(past.pace, tasks, workers=workers)
    if left is None:
        return "time: unknown, for there is no earlier record of any of these methods"
    unknown = sorted({task.method for task in tasks if not past.pace.knows(task)})
    guess = f"; {', '.join(unknown)} without any, taken as like the others" if unknown else ""
    return f"time: about {span(left)}, {workers} at a time, going by {counted(past.pace.seen, 'earlier record')}{guess}"


def _plain(planned: "Run", console: "Console") -> None:
    for count, finished in enumerate(planned.execute(), start=1):
        console.print(_line(count, len(planned.todo), finished), markup=False)


def _live(planned: "Run", console: "Console") -> None:
    """The table is drawn a few times a second, whatever the number of jobs; failures are lines above it."""
    import time

    from rich.live import Live

    from bench.core import outcome
    from bench.running.progress.board import Board
    from bench.running.progress.pace import span
    from bench.running.progress.past import Past

    past = Past(planned)
    jobs = [cell.job for cell in planned.todo]
    in_order = planned.options.engine == "local" and not planned.options.timing
    board = Board(jobs, past.task, past.pace, workers_of(planned), in_order=in_order)
    failures: list[str] = []
    outcomes: Counter[str] = Counter()
    printed = time.monotonic()
    live = Live(board, console=console, refresh_per_second=REFRESHES, transient=True)
    try:  # not `with`: Ctrl-C during the first drawing must give the cursor back too
        live.start(refresh=True)
        for count, (cell, record) in enumerate(planned.execute(), start=1):
            board.end(cell.job, record)
            outcomes[record.outcome.kind] += 1
            if not record.outcome.ok:
                failures.append(_line(count, len(jobs), (cell, record)))
            if failures and time.monotonic() - printed > 1 / REFRESHES:
                _print(console, failures)
                printed = time.monotonic()
        _print(console, failures)
    finally:
        live.stop()
    ended = ", ".join(
        f"{count} {name}" for name, count in sorted(outcomes.items(), key=lambda kind: kind[0] != outcome.OK)
    )
    console.print(f"{counted(len(jobs), 'job')} in {span(board.elapsed_s)}: {ended}", markup=False)


def _print(console: "Console", lines: list[str]) -> None:
    """Print and forget the lines."""
    if not lines:
        return
    more = [f"… and {len(lines) - MOST_LINES} more that did not end well"] if len(lines) > MOST_LINES else []
    console.print("\n".join([*lines[:MOST_LINES], *more]), markup=False)
    lines.clear()


def _line(count: int, total: int, finished: "Finished") -> str:
    """``12/40  instance  method  0.12 s  ok``."""
    cell, record = finished
    job, solve_s = cell.job, record.report.solve_s
    seconds = f"{solve_s:.2f} s" if solve_s is not None else ""
    return f"{count:>4}/{total}  {job.instance:<24} {job.label:<32} {seconds:>10}  {record.outcome.text}"
