"""``bench solve``: the user's own graph."""

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import PluginOption, UseOption, used


def solve(
    graph: Annotated[Path, typer.Argument(help="1DSfM folder, EGs.txt, .g2o or .npz.")],
    method: Annotated[str, typer.Option("--method", "-m", help="A selection, such as 'name[parameter=3]'.")],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help=".npz or .txt for the absolute rotations.")],
    seed: Annotated[int, typer.Option()] = 0,
    timeout: Annotated[float, typer.Option(metavar="SECONDS")] = 3600,
    memory: Annotated[float, typer.Option(metavar="GIB")] = 16,
    threads: Annotated[int, typer.Option(help="Threads of the numerical libraries.")] = 1,
    use: UseOption = None,
    plugin: PluginOption = None,
) -> None:
    """Solve one graph with one method and write the absolute rotations (world to camera)."""
    from bench.core.limits import Limits
    from bench.execution.single import SingleSolver
    from bench.formats import read_graph, rotations_writer
    from bench.plugins.catalog import catalog

    chosen = catalog("method", plugin or []).one(method)
    loaded = read_graph(graph)
    write = rotations_writer(out, loaded)
    problem = loaded.problem
    typer.echo(f"{graph}: {problem.n} cameras, {problem.m} edges")
    with SingleSolver(*chosen, Limits(timeout, memory, threads), used(use)) as solver:
        ended, report, estimate, _ = solver.solve(problem, seed)
    for note in (*loaded.notes, *report.notes):
        typer.echo(f"note: {note}")
    if estimate is None:
        typer.echo(f"{method}: {ended.text}", err=True)
        raise typer.Exit(1)
    residuals = problem.residuals(estimate.rotations)
    said = {"edges": loaded.cameras[problem.edges], "residuals": residuals, "stop_reason": estimate.stop_reason}
    if estimate.edge_weights is not None:
        said["edge_weights"] = estimate.edge_weights
    write(loaded.cameras, estimate.rotations, said)
    typer.echo(_summary(method, report.solve_s or 0.0, residuals))
    typer.echo(f"wrote {out}")


def _summary(method: str, seconds: float, residuals: "object") -> str:
    import numpy as np

    degrees = np.degrees(np.asarray(residuals, dtype=float))
    share = np.mean(degrees[np.isfinite(degrees)] < 5)
    return (
        f"{method}: {seconds:.2f} s, median edge residual {np.nanmedian(degrees):.3f} degrees, "
        f"{100 * share:.0f} % of edges below 5"
    )
