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
    from bench.core.errors import InputError
    from bench.plugins.catalog import catalog
    from bench.running.conformance import check_method

    chosen = catalog(kind.value, plugin or []).select([selection])
    if len(chosen) != 1:
        raise InputError(f"check takes one method at a time, and '{selection}' stands for {len(chosen)}")
    failed = 0
    for finding in check_method(*chosen[0]):
        failed += finding.result == "failed"
        detail = f"   {finding.detail}" if finding.detail else ""
        typer.echo(f"{finding.result:<8} {finding.check}{detail}")
    typer.echo(f"{selection}: " + (f"{failed} checks failed" if failed else "fit to be benchmarked"))
    raise typer.Exit(1 if failed else 0)
