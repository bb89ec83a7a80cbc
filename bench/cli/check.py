"""``bench check``: is a plug-in fit to be benchmarked?"""

from typing import Annotated

import typer

from bench.cli.new import Kind
from bench.cli.options import PluginOption


def check(
    kind: Annotated[Kind, typer.Argument()],
    selection: Annotated[str, typer.Argument(metavar="NAME", help="A selection, such as 'name[parameter=3]'.")],
    plugin: PluginOption = None,
) -> None:
    """Run the conformance checks on a method; exit code 1 when one fails."""
    from bench.plugins.catalog import catalog
    from bench.running.conformance import check_method

    chosen = catalog(kind.value, plugin or []).one(selection)
    failed = 0
    for finding in check_method(*chosen):
        failed += finding.result == "failed"
        detail = f"   {finding.detail}" if finding.detail else ""
        typer.echo(f"{finding.result:<8} {finding.check}{detail}")
    typer.echo(f"{selection}: " + (f"{failed} checks failed" if failed else "fit to be benchmarked"))
    raise typer.Exit(1 if failed else 0)
