"""``bench run``: compare methods, then say where tables and plots are."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import (
    Align,
    AlignOption,
    DataDirOption,
    Engine,
    PluginOption,
    ProtocolOption,
    Rerun,
    StyleOption,
    UseOption,
    WeightsOption,
    console,
    used,
    wear,
)
from bench.core.program import program
from bench.core.words import counted
from bench.running.progress.live import execute, foreseen

if TYPE_CHECKING:
    from bench.running.run import Run


def run(
    suite: Annotated[
        str | None, typer.Option("--suite", metavar="S", help="Named suite or TOML file.  [default: quick]")
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(
            "--method",
            "-m",
            metavar="M",
            help="In place of the suite's; a bare name is the default configuration. Repeatable.",
        ),
    ] = None,
    dataset: Annotated[
        list[str] | None,
        typer.Option(
            "--dataset",
            "-d",
            metavar="D",
            help="Only these; a bare name keeps the suite's selections of it. Repeatable.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of the run.  [default: results/runs/SUITE or SUITE-timing]"),
    ] = None,
    data_dir: DataDirOption = None,
    seeds: Annotated[int | None, typer.Option(metavar="N", help="Seeds 0 to N-1.")] = None,
    jobs: Annotated[int | None, typer.Option(metavar="N", help="Jobs at a time.  [default: one a core]")] = None,
    threads: Annotated[
        int | None, typer.Option(metavar="N", help="Threads of the numerical libraries in each job.  [default: 1]")
    ] = None,
    timeout: Annotated[float | None, typer.Option(metavar="S", help="Wall clock seconds of one job.")] = None,
    memory: Annotated[float | None, typer.Option(metavar="GIB", help="Resident memory of one job.")] = None,
    truth: Annotated[
        str | None,
        typer.Option(metavar="PATH", help="Absolute rotations, where -d names a path of your own."),
    ] = None,
    use: UseOption = None,
    weights: WeightsOption = None,
    protocol: ProtocolOption = None,
    align: AlignOption = Align.L1,
    timing: Annotated[
        bool,
        typer.Option("--timing", help="Time the methods: one job at a time on one core, taking turns, in rounds."),
    ] = False,
    rounds: Annotated[int | None, typer.Option(metavar="N", help="Rounds of a timing run.  [default: 5]")] = None,
    rerun: Annotated[Rerun, typer.Option(help="Which finished jobs are run again.")] = Rerun.NEVER,
    engine: Annotated[
        Engine, typer.Option(help="Where jobs run: children of this process, or the workers of a dask cluster.")
    ] = Engine.LOCAL,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Address of a dask scheduler, tcp://…  [default: a cluster on this machine]"
        ),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would run, and run nothing.")] = False,
    plugin: PluginOption = None,
    style: StyleOption = None,
) -> None:
    """Run a suite: every method on every instance, each job in a child process with limits.

    What is done and unchanged is not run again: after Ctrl-C, the same command continues.

    With --timing, the jobs are timed instead: the table has the median and least solve times and the ratio to the
    baseline of the suite (by default its first method).

    Example: --suite 1dsfm --data-dir DIR

    Example: -m 'dmf-synch[depth=[2,3]]' -m l1-irls -d 'folded[n=100]' --seeds 10
    """
    from bench.running.run import Options, Run

    wear(style)
    options = Options(
        out=out,
        data_dir=data_dir,
        seeds=seeds,
        jobs=jobs,
        threads=threads,
        timeout_s=timeout,
        memory_gib=memory,
        truth=truth or "",
        use=used(use),
        weights=weights,
        protocol=protocol,
        rerun=rerun.value,
        timing=timing,
        rounds=rounds,
        engine=engine.value,
        scheduler=scheduler,
        plugins=tuple(plugin or ()),
    )
    planned = Run(suite, method or (), dataset or (), options)
    typer.echo(_intention(planned))
    if dry_run:
        _list_cells(planned)
        return
    planned.prepare(typer.echo)
    execute(planned)
    _present(planned, align)


def _intention(planned: "Run") -> str:
    todo, total = len(planned.todo), len(planned.cells)
    instances = len({cell.job.instance_key for cell in planned.cells})
    done = f", {total - todo} of them done already" if todo < total else ""
    if planned.options.timing:
        done += f", timed in {counted(planned.experiment.suite.rounds, 'round')} against {planned.baseline}"
    return (
        f"suite {planned.experiment.suite.name}: {counted(total, 'job')} on {counted(instances, 'instance')}{done} "
        f"-> {planned.store.folder}"
    )


def _list_cells(planned: "Run") -> None:
    todo = {cell.job.id for cell in planned.todo}
    for cell in planned.cells:
        job = cell.job
        state = "to run" if job.id in todo else "done"
        typer.echo(f"{state:<7} {job.dataset} {job.instance} seed {job.seed} {job.label}")
    for sentence in planned.experiment.missing:
        typer.echo(f"missing: {sentence}")
    if planned.todo:
        typer.echo(foreseen(planned))


def _present(planned: "Run", align: Align) -> None:
    from bench.reporting.html.page import FILE_NAME, write_report
    from bench.reporting.present import render_table, write_plots, write_tables
    from bench.scoring.results import score, under_every_rule

    results = score(planned.store, align.value, planned.options.protocol, checkpoints=True)
    typer.echo(f"\n{render_table(results, 'console', **console())[0]}")
    folder = planned.store.folder
    write_tables(results, folder / "tables")
    plots = write_plots(results, folder / "plots")
    typer.echo(f"tables: {folder / 'tables'} (console, Markdown, CSV, LaTeX)")
    typer.echo(f"plots:  {folder / 'plots'} (PNG, PDF, SVG)" if plots else "plots:  none, nothing was scored")
    report = write_report(planned.store, under_every_rule(planned.store, results), folder / FILE_NAME)
    typer.echo(f"report: {report} (one HTML file, no network)")
    typer.echo(f"again:  {program()} table {folder} --align chordal --format latex")
