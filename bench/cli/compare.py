"""``bench compare``: one run against another, or one method of a run against others."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.cli.options import (
    Align,
    AlignOption,
    Format,
    ProtocolOption,
    StyleOption,
    console,
    run_folder,
    show,
    wear,
)

if TYPE_CHECKING:
    from bench.scoring.results import Results
    from bench.storage.store import Store


def compare(
    given: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN_A RUN_B | --methods METHOD [METHOD...] RUN",
            help="Two runs, folders or names: the second is judged. Or methods of one run: the first is judged.",
        ),
    ],
    methods: Annotated[
        bool, typer.Option("--methods", help="Compare methods of one run; a single one, with all others.")
    ] = False,
    align: AlignOption = Align.L1,
    protocol: ProtocolOption = None,
    threshold: Annotated[
        float, typer.Option(metavar="RATIO", help="A ratio nearer to one than this is no difference.")
    ] = 1.05,
    format: Format = Format.CONSOLE,
    style: StyleOption = None,
) -> None:
    """Say what became better or worse from one run to another, or whether one method of a run beats others.

    Of RUN_A and RUN_B, what both have is compared: the same problems, methods and seeds. Exit code 0: nothing is worse;
    1: a method's error or time is, or a job no longer ends well; 2: bad input.

    With --methods, the first method against each other one: their paired ratio on each scene and over all, with its
    95 % interval, p after Holm's correction, and on how many scenes it wins, ties and loses. Exit code 0, or 2 on bad
    input.
    """
    from bench.core.errors import InputError

    if not threshold >= 1:
        raise InputError(f"--threshold is a ratio of at least 1, such as 1.05, not {threshold:g}")
    wear(style)
    if methods:
        _methods(given, align.value, protocol, threshold, format)
    elif len(given) == 2:
        _runs(given[0], given[1], align.value, protocol, threshold, format)
    else:
        raise InputError(
            f"compare takes two runs, not {len(given)}; or, after --methods, methods of one run and then the run"
        )


def _methods(given: list[str], align: str, protocol: str | None, threshold: float, format: Format) -> None:
    from bench.core.errors import InputError
    from bench.reporting.tables.contested import contest_grids
    from bench.reporting.tables.render import text_of
    from bench.scoring.contest import contest
    from bench.scoring.results import score
    from bench.storage.store import Store

    *names, run = given
    if not names:
        raise InputError("compare --methods takes one method or more, and then the run: --methods METHOD METHOD RUN")
    found = contest(score(Store.open(run_folder(Path(run))), align, protocol), names, threshold)
    show(text_of(contest_grids(found, align, threshold), found.rows, format.value, **console()))


def _runs(first: str, second: str, align: str, protocol: str | None, threshold: float, format: Format) -> None:
    from bench.reporting.tables.compared import comparison_grid, comparison_table, verdict
    from bench.reporting.tables.render import text_of
    from bench.scoring.comparison import compare as compared
    from bench.scoring.results import score
    from bench.storage.store import Store

    stores = [Store.open(run_folder(Path(run))) for run in (first, second)]
    old, new = (score(store, align, protocol) for store in stores)
    found = compared(old, new, threshold, no_times=_why_no_times(stores, [old, new]))
    grid = comparison_grid(found, align, threshold)
    show(text_of([grid], comparison_table(found), format.value, **console()))
    typer.echo(verdict(found), err=format is Format.CSV)
    raise typer.Exit(1 if found.regressed else 0)


def _why_no_times(stores: "list[Store]", results: "list[Results]") -> str:
    """Why the times of two runs are not comparable; "" where they are."""
    if not all("round_s" in scored.frame for scored in results):
        return "both have to be timing runs (run --timing)"
    machines = [
        {
            (record.provenance.get("cpu"), record.limits.threads)
            for job in scored.frame["job"]
            if (record := store.record(job))
        }
        for store, scored in zip(stores, results, strict=True)
    ]
    return "" if machines[0] == machines[1] else "the runs are from different processors or with other threads"
