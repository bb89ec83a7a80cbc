"""``bench info``: everything that is known of one method or dataset."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from bench.cli.options import PluginOption, console

if TYPE_CHECKING:
    from bench.plugins.catalog import Catalog
    from bench.plugins.declare import Info


def info(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A method or a dataset, see `list`.")],
    plugin: PluginOption = None,
) -> None:
    """Say what a method or dataset is: steps, parameters with defaults and ranges, promises, packages, references."""
    from bench.core.errors import InputError, shown, suggestion
    from bench.plugins.catalog import catalog

    known: list[Catalog[Any]] = [catalog("method", plugin or []), catalog("dataset", plugin or [])]
    found = [one.entries[name] for one in known if name in one.entries]
    if not found and any(one.broken for one in known):
        known[0][name]  # which says why, where it is a broken one
    if not found:
        names = [entry for one in known for entry in one.entries]
        raise InputError(f"there is no method or dataset {shown(name)}{suggestion(name, names)}")
    for one in found:
        describe(one)


def describe(one: "Info") -> None:
    """Print what there is to know of a plug-in."""
    from bench.plugins.describe import described
    from bench.reporting.described import text_of

    typer.echo(text_of(described(one), console()["width"]), nl=False)
