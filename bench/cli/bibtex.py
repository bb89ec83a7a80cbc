"""``bench bibtex``: what a paper that uses a run has to cite."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import run_folder

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bench.plugins.declare import Info
    from bench.suite.plan import Job


def bibtex(
    run: Annotated[
        Path | None,
        typer.Argument(metavar="[RUN]", help="Folder of a run, or its name; without it, the benchmark alone."),
    ] = None,
) -> None:
    """Print the BibTeX entries of the benchmark, of the paper it starts from, and of the methods and datasets of a run.

    What has no entry is named on standard error.
    """
    from bench.plugins.references import bibliography, cite_keys
    from bench.storage.store import Store

    plans = Store.open(run_folder(run)).plans() if run else []
    used = list(_used([job for plan in plans for job in plan.jobs]))
    typer.echo("\n\n".join(bibliography(used).values()))
    for info in used:
        if not cite_keys(info):
            typer.echo(f"{info.kind} {info.name} declares no reference", err=True)


def _used(jobs: "list[Job]") -> "Iterator[Info]":
    """Methods and datasets of the jobs, in their order; what is no longer there is said on standard error."""
    from bench.plugins import selection
    from bench.plugins.catalog import catalog

    newest = {job.method: job.origin for job in jobs}  # a run may hold two versions of a file
    plugins = [path for path in dict.fromkeys(newest.values()) if Path(path).is_file()]
    names = {
        "dataset": dict.fromkeys(selection.parse(job.dataset).name for job in jobs),
        "method": dict.fromkeys(job.method for job in jobs),
    }
    for kind, wanted in names.items():
        known = catalog(kind, plugins).entries
        for name in wanted:
            if name in known:
                yield known[name]
            else:
                typer.echo(f"{kind} {name} is not installed here: its reference is missing", err=True)
