"""``bench data``: what is on disk, and how to get the rest."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bench.cli.options import DataDirOption, ProtocolOption
from bench.core.words import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bench.plugins.declare import Missing, Source

app = typer.Typer(help="List, fetch, verify and inspect data.", no_args_is_help=True)

Name = Annotated[str, typer.Argument(metavar="DATASET", help="A selection, such as 'name[scene=x]'.")]


@app.command("list")
def list_(
    name: Annotated[
        str | None, typer.Argument(metavar="[DATASET]", help="A selection.  [default: every dataset]")
    ] = None,
    data_dir: DataDirOption = None,
    protocol: ProtocolOption = None,
) -> None:
    """List instances: here, missing (with the command that gets them), or made anew for every seed."""
    from bench.plugins.declare import Missing

    for dataset, source in _sources(name, data_dir, protocol):
        if isinstance(source, Missing):
            state, detail = "missing", source.how(dataset)
        else:
            state, detail = "made" if source.seeded else "here", source.revision[:12]
        typer.echo(f"{state:<9} {f'{dataset}/{source.name}':<34} {detail}")


@app.command("inspect")
def inspect(name: Name, data_dir: DataDirOption = None, protocol: ProtocolOption = None) -> None:
    """Load the instances of a dataset and print what is known of them."""
    import numpy as np

    from bench.plugins.declare import Missing
    from bench.scoring.doubts import doubts

    for dataset, source in _sources(name, data_dir, protocol):
        if isinstance(source, Missing):
            typer.echo(f"{source.name}: not on disk; {source.how(dataset)}")
            continue
        instance = source.load()
        problem = instance.problem
        size = f"{counted(problem.n, 'camera')}, {counted(problem.m, 'edge')}"
        typer.echo(f"{instance.name}: {size}, protocol {instance.protocol}")
        sizes = np.bincount(problem.components)
        typer.echo(f"  components {', '.join(map(str, sizes[:8]))}{'…' if len(sizes) > 8 else ''}")
        for key, value in instance.statistics.items():
            typer.echo(f"  {key} {value:.4g}")
        if instance.truth is not None:
            known = np.isfinite(instance.truth).all(axis=(1, 2))
            residuals = np.degrees(problem.residuals(instance.truth))
            residuals = residuals[np.isfinite(residuals)]
            typer.echo(
                f"  truth on {known.sum()} cameras; residual of the measurements there: median "
                f"{np.median(residuals):.2f} degrees, {100 * np.mean(residuals > 30):.1f} % over 30"
            )
        typer.echo(f"  source {instance.source}, revision {instance.revision[:12]}")
        for note in (*instance.notes, *doubts(instance)):
            typer.echo(f"  note: {note}")


@app.command("formats")
def formats() -> None:
    """List the files that are read and written."""
    from bench.formats import known_formats

    for form in known_formats():
        able = {"graph": form.graph, "rotations": form.rotations, "written": form.write}
        can = ", ".join(what for what, how in able.items() if how)
        typer.echo(f"{form.name:<16} {can:<26} {' '.join(form.hints):<28} {form.summary}")


@app.command("fetch")
def fetch(
    name: Annotated[str, typer.Argument(metavar="DATASET")],
    to: Annotated[
        Path | None, typer.Option("--to", metavar="DIR", help="Folder.  [default: the download cache]")
    ] = None,
) -> None:
    """Download a dataset: checksum, progress, resumed where it was interrupted."""
    configured = _fetchable(name)
    typer.echo(f"{name} is in {configured.fetch(to)}")


@app.command("verify")
def verify(name: Annotated[str, typer.Argument(metavar="DATASET")], data_dir: DataDirOption = None) -> None:
    """Read every instance on disk and say what is wrong; exit code 1 where something is."""
    from bench.plugins.declare import Missing
    from bench.scoring.doubts import doubts

    wrong = 0
    here = {source.name: source for _, source in _sources(name, data_dir, None) if not isinstance(source, Missing)}
    for scene, state in _fetchable(name).verify(data_dir):
        said = [state, *(doubts(here[scene].load()) if state == "ok" and scene in here else ())]
        wrong += state != "ok"
        typer.echo(f"{scene:<24} {'; '.join(said)}")
    raise typer.Exit(1 if wrong else 0)


def _sources(name: str | None, data_dir: Path | None, protocol: str | None) -> "Iterator[tuple[str, Source | Missing]]":
    """Every instance of a selection, or of all datasets, with the name of its dataset."""
    from bench.plugins.catalog import catalog
    from bench.plugins.sources import sources_of

    known = catalog("dataset")
    every = (info.name for info in known if not info.facts["takes_paths"])
    for info, parameters in known.select([known.with_paths(name)] if name else every):
        if protocol is not None and "protocol" in info.defaults():
            parameters |= {"protocol": protocol}
        for source in sources_of(info, info.configure(parameters), data_dir, 0):
            yield info.name, source


def _fetchable(name: str) -> Any:
    from bench.core.errors import InputError
    from bench.plugins.catalog import catalog

    info = catalog("dataset")[name]
    if not info.facts["fetchable"]:
        raise InputError(f"dataset '{name}' is made on this machine; there is nothing to fetch")
    return info.configure({})
