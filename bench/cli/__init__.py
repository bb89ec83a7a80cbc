"""The command line: one verb a file, nothing but argument parsing and calls downward.

Nothing heavy is imported before a verb runs, so that ``--help`` answers at once.
"""

import sys

import typer

from bench.cli import check, data, list_, new, paper, plot, report, run, solve, table

app = typer.Typer(
    name="bench",
    help="Compare rotation synchronization (multiple rotation averaging) methods.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.command("run", epilog=run.EPILOG)(run.run)
app.command("list")(list_.list_)
app.command("table")(table.table)
app.command("plot")(plot.plot)
app.command("report")(report.report)
app.command("paper")(paper.paper)
app.add_typer(data.app, name="data")
app.command("solve")(solve.solve)
app.command("new")(new.new)
app.command("check")(check.check)


def main() -> None:
    """Run the command line; bad input is one sentence and exit code 2."""
    from bench.errors import InputError

    try:
        app(prog_name="python -m bench")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
