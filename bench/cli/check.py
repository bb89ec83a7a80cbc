"""``bench check``: is a plug-in fit to be benchmarked?"""

from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from bench.cli.new import Kind
from bench.cli.options import DataDirOption, PluginOption

if TYPE_CHECKING:
    from bench.plugins.catalog import Catalog


def check(
    kind: Annotated[Kind, typer.Argument()],
    selection: Annotated[str, typer.Argument(metavar="NAME", help="A selection, such as 'name[parameter=3]'.")],
    plugin: PluginOption = None,
    data_dir: DataDirOption = None,
) -> None:
    """Run the conformance checks on a method or a dataset; exit code 1 when one fails."""
    from bench.plugins.catalog import catalog, plugin_path
    from bench.plugins.declare import DatasetInfo, MethodInfo
    from bench.running.conformance import check_method
    from bench.running.conformance_datasets import check_dataset

    known = catalog(kind.value, plugin or [])
    _declares_some(known, [plugin_path(path) for path in plugin or []])
    info, parameters = known.one(selection)
    failed = 0
    if isinstance(info, MethodInfo):
        made = check_method(info, parameters)
    else:
        made = check_dataset(cast(DatasetInfo, info), parameters, data_dir)
    for finding in made:
        failed += finding.result == "failed"
        detail = f"   {finding.detail}" if finding.detail else ""
        typer.echo(f"{finding.result:<8} {finding.check}{detail}")
    typer.echo(f"{selection}: " + (f"{failed} check{'s' * (failed > 1)} failed" if failed else "fit to be benchmarked"))
    raise typer.Exit(1 if failed else 0)


def _declares_some(known: "Catalog[Any]", origins: list[str]) -> None:
    """Refuse a file in which nothing is declared, as where the decorator was forgotten."""
    from bench.core.errors import InputError

    silent = set(origins) - {info.origin for info in known} - set(known.broken)
    for origin in sorted(silent):
        raise InputError(
            f"{origin} declares no {known.kind}: put @{known.kind}('name', title='Title') above a frozen dataclass"
        )
