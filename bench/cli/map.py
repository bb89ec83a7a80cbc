"""``bench map``: where, over two parameters of a dataset, each method breaks down."""

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import Align, DataDirOption, PluginOption
from bench.running.progress.live import execute

NAME = "map"


def map_(
    method: Annotated[list[str], typer.Option("--method", "-m", metavar="M", help="Repeatable.")],
    dataset: Annotated[str, typer.Option("--dataset", "-d", metavar="D", help="Its other parameters stay the same.")],
    x: Annotated[str, typer.Option("--x", metavar="AXIS", help="NAME=FROM:TO[:log], a parameter of the dataset.")],
    y: Annotated[str, typer.Option("--y", metavar="AXIS", help="The same, another parameter.")],
    cells: Annotated[str, typer.Option(metavar="N", help="Cells per side, or along x and y: 16x12.")] = "12",
    seeds: Annotated[int, typer.Option(metavar="N", help="Samples per cell, at most; the majority counts.")] = 3,
    success: Annotated[
        str,
        typer.Option(
            metavar="BOUND",
            help="Success is a median error below that many degrees, or (2x) that many times what is possible.",
        ),
    ] = "5",
    budget_solves: Annotated[int | None, typer.Option(metavar="N", help="Stop after that many solves.")] = None,
    full: Annotated[bool, typer.Option("--full", help="Solve the full grid instead.")] = False,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder.  [default: results/runs/map]")] = None,
    align: Annotated[Align, typer.Option(help="Rule that removes the gauge.")] = Align.L1,
    data_dir: DataDirOption = None,
    jobs: Annotated[int | None, typer.Option(metavar="N", help="Jobs at a time.  [default: one a core]")] = None,
    timeout: Annotated[float | None, typer.Option(metavar="S", help="Wall clock seconds of one job.")] = None,
    memory: Annotated[float | None, typer.Option(metavar="GIB", help="Resident memory of one job.")] = None,
    plugin: PluginOption = None,
) -> None:
    """Map where methods break down, solving mostly along the boundary.

    A coarse lattice first; then cells between neighbours that disagree, and further seeds where the outcome is
    unsure. What is stored is not solved again: after Ctrl-C, the same command continues. `n` and `noise_deg` can
    be axes as well as `missing` and `outliers`.

    Example: -m l1-irls -d 'erdos-renyi[n=50]' --x missing=0:0.9 --y outliers=0:0.9
    """
    from bench.core.errors import InputError
    from bench.maps.make import read_sweep, write
    from bench.maps.sweep import PhaseMap
    from bench.running.run import RUNS_FOLDER, Options

    plugins = tuple(plugin or ())
    if budget_solves is not None and budget_solves < 1:
        raise InputError(f"--budget-solves must be above zero, not {budget_solves}")
    sweep = read_sweep(method, dataset, (x, y), cells, seeds, success, align.value, plugins)
    folder = out or RUNS_FOLDER / NAME
    options = Options(out=folder, data_dir=data_dir, jobs=jobs, timeout_s=timeout, memory_gib=memory, plugins=plugins)
    phase_map = PhaseMap(sweep, options)
    typer.echo(
        f"map of {sweep.x.parameter} x {sweep.y.parameter}: {phase_map.grid} solves in the full grid -> {folder}"
    )
    complete = phase_map.explore(execute, full=full, budget=budget_solves, tell=typer.echo)
    for path in write(phase_map, folder / "maps", "map-full" if full else "map", typer.echo):
        typer.echo(path)
    if not complete:
        typer.echo("the budget ended before every boundary was known; a larger --budget-solves continues")
