"""``bench train``: the weights of a method that learns."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import PluginOption, console, show


def train(
    method: Annotated[str, typer.Argument(metavar="METHOD", help="One that learns; `list methods` says which.")],
    seed: Annotated[int, typer.Option(min=0, help="Of the graphs, the first weights and the order.")] = 0,
    cpu_minutes: Annotated[
        float | None, typer.Option(min=0, metavar="M", help="Stop after this much processor time.  [default: 20]")
    ] = None,
    steps: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Stop after this many steps: the same weights every time.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="For weights, curve and state.  [default: results/runs/train-…]")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the training in that folder.")] = False,
    topologies: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Graphs whose cameras and edges are simulated on, as 1DSfM or .npz."),
    ] = None,
    dataset: Annotated[
        list[str] | None,
        typer.Option("--dataset", "-d", metavar="D", help="Learn from these instead of the method's.  Repeatable."),
    ] = None,
    graphs: Annotated[int, typer.Option(min=1, metavar="N", help="Graphs to learn from.")] = 300,
    held_out: Annotated[int, typer.Option(min=2, metavar="N", help="Graphs to judge by.")] = 24,
    plugin: PluginOption = None,
) -> None:
    """Train a method on simulated graphs, and judge it on others.

    Writes the weights and where they come from, for `--weights` of `run` and `solve`; the learning curve; what
    `--resume` needs; and a table of the trained method beside classical ones on graphs that it has not seen.

    Example: METHOD --cpu-minutes 120 --topologies DIR
    """
    from bench.reporting.present import write_training
    from bench.reporting.tables.render import text_of
    from bench.reporting.tables.trained import validation_grid
    from bench.running.run import RUNS_FOLDER
    from bench.training.train import WEIGHTS, Budget, Settings
    from bench.training.train import train as trained

    folder = out or RUNS_FOLDER / f"train-{method}"
    minutes = cpu_minutes if cpu_minutes is not None else 20.0 if steps is None else float("inf")
    settings = Settings(folder, tuple(dataset or ()), graphs, held_out, seed, topologies, tuple(plugin or ()), resume)
    found = trained(method, settings, Budget(float("inf") if steps is None else steps, minutes), _tell)
    for sentence in found.absent:
        typer.echo(f"left out: {sentence}", err=True)
    show(text_of([validation_grid(found.rows, held_out)], found.frame, "console", **console()))
    write_training(method, found, folder)
    typer.echo(f"weights: {folder / WEIGHTS}; {found.verdict}")


def _tell(row: Mapping[str, float]) -> None:
    typer.echo(
        f"step {row['steps']:>6.0f} {row['cpu_s'] / 60:7.1f} min  loss {row['loss']:.4f}, held out "
        f"{row['held_out_loss']:.4f}, error {row['mean_deg']:.2f} mean {row['median_deg']:.3f} median"
    )
