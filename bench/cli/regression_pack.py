"""``bench regression-pack``: small graphs for the continuous integration of a library, and two versions compared."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import Format, PluginOption, console, run_folder, show
from bench.core.words import counted

if TYPE_CHECKING:
    from bench.running.run import Run
    from bench.storage.store import Store
    from bench.suite.plan import Job

SUITE = "regression-pack"
MOST_LINES = 40  # failures that are listed


def regression_pack(
    method: Annotated[
        list[str] | None,
        typer.Option(
            "--method", "-m", metavar="M", help="In place of the suite's; its package must be there. Repeatable."
        ),
    ] = None,
    plugin: PluginOption = None,
    python: Annotated[
        Path | None,
        typer.Option(
            metavar="PYTHON", help="Another interpreter with bench in it: its versions are compared with these."
        ),
    ] = None,
    against: Annotated[
        Path | None, typer.Option(metavar="RUN", help="An earlier run of the pack that this one is compared with.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the run.  [default: results/runs/regression-pack]")
    ] = None,
    seeds: Annotated[int | None, typer.Option(metavar="N", help="Seeds 0 to N-1.  [default: 3]")] = None,
    jobs: Annotated[int | None, typer.Option(metavar="N", help="Jobs at a time.  [default: one a core]")] = None,
    threshold: Annotated[
        float, typer.Option(metavar="RATIO", help="A change by less than this ratio is no regression.")
    ] = 1.05,
    format: Format = Format.CONSOLE,
) -> None:
    """Run some twenty small simulated graphs, and say whether every method works on each of them.

    Trees, rings, sequences, planar, disconnected and near-singular graphs, repeated structure, match counts,
    information and gravity are made from seeds. Everything is run again each time. A method works where its job ends
    well, solves the whole largest component and keeps its median error below what working methods have.

    With --python or --against, another version's answers are paired with these, graph by graph and seed by seed.

    Exit code 0: every method works, and nothing is worse than the other version's; 1: something fails or is worse; 2:
    bad input.

    Example: -m colmap --python ../main/venv/bin/python
    """
    from bench.core.errors import InputError
    from bench.running.progress.live import execute
    from bench.running.run import RUNS_FOLDER, Options, Run

    if python and against:
        raise InputError("--python and --against both name what is compared with: leave out one")
    if not threshold >= 1:
        raise InputError(f"--threshold is a ratio of at least 1, such as 1.05, not {threshold:g}")
    folder = out or RUNS_FOLDER / SUITE
    options = Options(out=folder, seeds=seeds, jobs=jobs, plugins=tuple(plugin or ()), rerun="always")
    planned = Run(SUITE, method or (), (), options)
    other = _other_version(planned, python, method or []) if python else run_folder(against) if against else None
    planned.prepare()
    execute(planned, stderr=True)
    failed = _failed(planned, needed=bool(method))
    worse = _compared(planned, other, threshold, format) if other else False
    raise typer.Exit(1 if failed or worse else 0)


def _failed(planned: "Run", needed: bool) -> int:
    """List what does not work; how many jobs that are."""
    from bench.scoring.acceptance import failures
    from bench.scoring.results import score

    jobs = [cell.job for cell in planned.cells]
    results = score(planned.store, jobs=jobs)
    found = list(failures(planned.store, results, jobs, planned.options.plugins, needed=needed))
    for failure in found[:MOST_LINES]:
        typer.echo(f"failed: {failure}")
    if len(found) > MOST_LINES:
        typer.echo(f"… and {len(found) - MOST_LINES} more")
    idle = sum(results.frame["outcome"] == "not-installed") if not needed else 0
    left = f", {idle} left out for want of their package" if idle else ""
    typer.echo(f"{counted(len(jobs), 'job')} on small graphs: {len(found)} failed{left} -> {planned.store.folder}")
    return len(found)


def _other_version(planned: "Run", python: Path, methods: list[str]) -> Path:
    """Run the same with another interpreter, in a folder beside this one's; nothing is drawn of it."""
    import json
    import subprocess

    from bench.core.errors import InputError

    options, folder = planned.options, planned.store.folder
    other = folder.with_name(f"{folder.name}-other")
    given = {
        "suite": SUITE,
        "methods": methods,
        "out": str(other),
        "plugins": [str(path) for path in options.plugins],
        "seeds": options.seeds,
        "jobs": options.jobs,
        "rerun": "always",
    }
    words = [str(python), "-c", "import bench, json, sys; bench.run(**json.loads(sys.argv[1]))", json.dumps(given)]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    except OSError as error:
        raise InputError(f"--python {python}: {error.strerror}") from error
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
        raise InputError(f"--python {python} cannot run the pack; is rotsync-bench installed there? {last}")
    return other


def _compared(planned: "Run", other: Path, threshold: float, format: Format) -> bool:
    """Print what became better or worse from the other version to this one; whether anything is worse."""
    from bench.reporting.tables.compared import comparison_grid, comparison_table, verdict
    from bench.reporting.tables.render import text_of
    from bench.scoring.comparison import compare
    from bench.scoring.results import score
    from bench.storage.store import Store

    stores = Store.open(other), planned.store
    jobs = [cell.job for cell in planned.cells]
    old, new = score(stores[0]), score(stores[1], jobs=jobs)
    found = compare(old, new, threshold, no_times="the pack is no timing run")
    grid = comparison_grid(found, "l1", threshold)
    show(text_of([grid], comparison_table(found), format.value, **console()))
    before, after = (_versions(store, store.jobs()) for store in stores)
    for name in sorted(before.keys() & after.keys()):
        if before[name] != after[name]:
            typer.echo(f"{name} {before[name]} -> {after[name]}", err=True)
    typer.echo(verdict(found), err=format is Format.CSV)
    return found.regressed


def _versions(store: "Store", jobs: "list[Job]") -> dict[str, str]:
    """Versions of the packages that the jobs used."""
    records = (store.record(job.id) for job in jobs)
    return {name: version for record in records if record for name, version in record.versions.items()}
