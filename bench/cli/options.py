"""Options that several verbs share."""

import shutil
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from bench.core.problem import Information
    from bench.reporting.tables import render

Align = StrEnum("Align", ["L1", "CHORDAL", "KARCHER", "ANCHORS"])  # rules that remove the gauge
By = StrEnum("By", ["SCENE", "COLLECTION"])  # what a table is of
Format = StrEnum("Format", ["CONSOLE", "MARKDOWN", "CSV", "LATEX"])  # how a table is written


class Rerun(StrEnum):
    """Which finished jobs are run again."""

    NEVER = "never"
    FAILED = "failed"
    ALWAYS = "always"


class Engine(StrEnum):
    """What places the jobs."""

    LOCAL = "local"
    DASK = "dask"


RunFolder = Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run, or its name under results/runs.")]
AlignOption = Annotated[Align, typer.Option("--align", help="Rule that removes the gauge; re-scores without running.")]
ProtocolOption = Annotated[
    str | None,
    typer.Option("--protocol", metavar="P", help="Which cameras are solved and scored, where data give a choice."),
]
PluginOption = Annotated[
    list[Path] | None,
    typer.Option("--plugin", metavar="FILE", help="Python file with more methods or datasets."),
]
UseOption = Annotated[
    str | None,
    typer.Option(
        "--use",
        metavar="WHAT",
        help="What to use besides rotations: weights,precisions,gravity or none.  [default: all a method can]",
    ),
]
WeightsOption = Annotated[
    Path | None,
    typer.Option("--weights", metavar="FILE", help="What `train` wrote, for the method that it trained."),
]
DataDirOption = Annotated[
    Path | None, typer.Option("--data-dir", metavar="DIR", help="Folder where data are looked for first.")
]
StyleOption = Annotated[
    Path | None,
    typer.Option(
        "--style",
        metavar="FILE",
        help="TOML file of fonts, colours and names.  [default: bench-style.toml, if present]",
    ),
]


def wear(given: Path | None = None, width: str | None = None) -> None:
    """Put a style file in force, saying on standard error which; and a width of figures."""
    from dataclasses import replace

    from bench.reporting.appearance import find, put_in_force, width_in

    wanted, path = find(given)
    if path:
        typer.echo(f"style: {path}", err=True)
    if width is not None:
        wanted = replace(wanted, width_in=width_in(width))
    put_in_force(wanted)


def console() -> dict[str, Any]:
    """Columns of the terminal, and whether there is one: what a table has to know of it."""
    return {"width": shutil.get_terminal_size((100, 24)).columns, "terminal": sys.stdout.isatty()}


def show(table: tuple[str, tuple[str, ...]]) -> None:
    """Print a table on standard output, and the notes that are not in it on standard error."""
    text, notes = table
    typer.echo(text, nl=not text.endswith("\n"))
    for note in notes:
        typer.echo(note, err=True)


def used(given: str | None) -> "tuple[Information, ...] | None":
    """What ``--use`` allows; None where it was not given."""
    from bench.core.errors import InputError, suggestion
    from bench.core.problem import INFORMATION

    if given is None:
        return None
    names = [] if given == "none" else given.split(",")
    for name in names:
        if name not in INFORMATION:
            raise InputError(
                f"--use takes {','.join(INFORMATION)} or none, not '{name}'{suggestion(name, INFORMATION)}"
            )
    return tuple(name for name in INFORMATION if name in names)


def tables_of(given: By | None) -> "render.By | None":
    """What ``--by`` asks for; None where it was not given."""
    return None if given is None else "scene" if given is By.SCENE else "collection"


def run_folder(given: Path) -> Path:
    """Folder of a run from its path or its name."""
    from bench.running.run import RUNS_FOLDER

    named = RUNS_FOLDER / given
    return named if not given.exists() and named.is_dir() else given
