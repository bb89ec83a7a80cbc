"""``bench solve``: the user's own graph."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import PluginOption, UseOption, WeightsOption, used
from bench.core.words import counted

if TYPE_CHECKING:
    from bench.core.problem import Estimate, Problem


def solve(
    graph: Annotated[Path, typer.Argument(help="A file or folder; what is read is listed by `data formats`.")],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FILE", help="File for the absolute rotations; see `data formats`.")
    ],
    method: Annotated[
        str | None,
        typer.Option("--method", "-m", help="A selection, such as 'name[parameter=3]'.  [default: a robust one]"),
    ] = None,
    seed: Annotated[int, typer.Option()] = 0,
    timeout: Annotated[float, typer.Option(metavar="SECONDS")] = 3600,
    memory: Annotated[float, typer.Option(metavar="GIB")] = 16,
    threads: Annotated[int, typer.Option(help="Threads of the numerical libraries.")] = 1,
    use: UseOption = None,
    weights: WeightsOption = None,
    plugin: PluginOption = None,
) -> None:
    """Solve one graph with one method and write the absolute rotations (world to camera)."""
    from bench.core.limits import Limits
    from bench.core.problem import Instance
    from bench.execution.single import SingleSolver
    from bench.formats import read_graph, rotations_writer
    from bench.learning.override import with_weights
    from bench.plugins.catalog import catalog, default_method
    from bench.scoring.doubts import doubts

    (chosen,) = with_weights([method or default_method()], weights)
    info, parameters = catalog("method", plugin or []).one(chosen)
    loaded = read_graph(graph)
    write = rotations_writer(out, loaded)
    problem = loaded.problem
    typer.echo(f"{graph}: {counted(problem.n, 'camera')}, {counted(problem.m, 'edge')}")
    with SingleSolver(info, parameters, Limits(timeout, memory, threads), used(use)) as solver:
        ended, report, estimate, _ = solver.solve(problem, seed)
    for note in (*loaded.notes, *report.notes, *doubts(Instance(problem, None, str(graph), ids=loaded.cameras))):
        typer.echo(f"note: {note}")
    if estimate is None:
        typer.echo(f"{chosen}: {ended.text}", err=True)
        raise typer.Exit(1)
    for name in sorted(problem.carries):
        typer.echo(f"{name}: {'used' if name in report.used else f'not used by {chosen}'}")
    residuals = problem.residuals(estimate.rotations)
    said = {"edges": loaded.cameras[problem.edges], "residuals": residuals, "stop_reason": estimate.stop_reason}
    optional = {"edge_weights": estimate.edge_weights, "camera_sigma": estimate.camera_sigma}
    said |= {what: values for what, values in optional.items() if values is not None}
    write(loaded.cameras, estimate.rotations, said)
    ended_by = f", ended by: {estimate.stop_reason}" if estimate.stop_reason else ""
    typer.echo(f"{chosen}: {report.solve_s or 0.0:.2f} s{ended_by}{_fit(problem, estimate)}")
    typer.echo(f"wrote {out}")


def _fit(problem: "Problem", estimate: "Estimate") -> str:
    """How well the measurements fit that lie in loops; nothing of a tree, which always fits."""
    import numpy as np

    from bench.core.redundancy import in_no_loop

    degrees = np.degrees(problem.residuals(estimate.rotations)[~in_no_loop(problem)])
    degrees = degrees[np.isfinite(degrees)]
    if not len(degrees):
        return ""
    return (
        f", median edge residual {np.median(degrees):.3f} degrees, {100 * np.mean(degrees < 5):.0f} % of edges below 5"
    )
