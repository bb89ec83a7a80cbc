"""The command line: one verb a file, nothing but argument parsing and calls downward.

Nothing heavy is imported before a verb runs, so that ``--help`` answers at once.
"""

import errno
import sys
from typing import Annotated

import typer

from bench import __version__
from bench.cli import (
    bibtex,
    calibrate,
    check,
    compare,
    data,
    doctor,
    export,
    info,
    list_,
    map,
    merge,
    new,
    paper,
    plot,
    recommend,
    regression_pack,
    report,
    rerun,
    run,
    score,
    site,
    solve,
    table,
    train,
)
from bench.core.program import SCRIPT, program

COMPLETION = ("--install-completion", "--show-completion")
REFUSED = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _say_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"{SCRIPT} {__version__}")
        raise typer.Exit


@app.callback()
def bench(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_say_version, help="Print the version.")
    ] = False,
) -> None:
    """Compare rotation synchronization (multiple rotation averaging) methods."""


VERBS = (
    *(
        run.run,
        rerun.rerun,
        list_.list_,
        info.info,
        table.table,
        plot.plot,
        compare.compare,
        report.report,
        paper.paper,
    ),
    *(
        export.export,
        site.site,
        merge.merge,
        doctor.doctor,
        bibtex.bibtex,
        map.map_,
        solve.solve,
        score.score,
        new.new,
        check.check,
    ),
    *(calibrate.calibrate, regression_pack.regression_pack, recommend.recommend, train.train),
)
for verb in VERBS:
    app.command(verb.__name__.rstrip("_").replace("_", "-"))(verb)
app.add_typer(data.app, name="data")


def main() -> None:
    """Run the command line; bad input, or a disk that takes no more, is one sentence and exit code 2."""
    from bench.core.errors import InputError

    try:
        # A shell completes a command by its name: that of the script, for it cannot be `python`.
        name = SCRIPT if any(word.startswith(COMPLETION) for word in sys.argv[1:2]) else program()
        app(prog_name=name, complete_var=f"_{SCRIPT.upper().replace('-', '_')}_COMPLETE")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except OSError as error:
        if error.errno not in REFUSED:
            raise
        print(f"error: {error.filename or 'output'}: {error.strerror}; what is finished is kept", file=sys.stderr)
        sys.exit(2)
