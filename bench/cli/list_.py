"""``bench list``: what there is."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import PluginOption

What = StrEnum("What", ["METHODS", "DATASETS", "SUITES", "PAPERS"])  # that can be listed


def list_(
    what: Annotated[What, typer.Argument()],
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="Describe this method or dataset instead.")] = "",
    plugin: PluginOption = None,
) -> None:
    """List methods, datasets, suites or papers; broken plug-ins are listed with the reason."""
    from bench.cli.info import describe
    from bench.core.errors import InputError
    from bench.plugins.catalog import catalog

    kind = what.value.removesuffix("s")
    if what in (What.SUITES, What.PAPERS):
        if name:
            raise InputError(f"list {what.value} takes no name: its list says everything; leave out '{name}'")
        _list_suites() if what is What.SUITES else _list_papers()
    elif name:
        describe(catalog(kind, plugin or [])[name])
    else:
        _list_plugins(kind, plugin or [])


def _list_suites() -> None:
    from bench.suite.experiment import load_suite, suite_names

    for name in suite_names():
        suite = load_suite(name)
        typer.echo(f"{name:<13} {suite.title}")


def _list_papers() -> None:
    from bench.papers.layout import load_layout, paper_names

    for name in paper_names():
        layout = load_layout(name)
        typer.echo(f"{name:<15} {layout.title}")
        typer.echo(f"{'':<15}   cite {layout.cite}")
        for item, content in layout.items.items():
            typer.echo(f"{'':<15}   {item}: {content.title}")


def _list_plugins(kind: str, plugins: list[Path]) -> None:
    from bench.plugins import selection
    from bench.plugins.catalog import catalog

    found = catalog(kind, plugins)
    for info in sorted(found, key=lambda info: info.name):
        state = f"   not installed: {info.install_hint()}" if info.not_installed() else ""
        typer.echo(f"{info.name:<16} {info.summary}{state}")
        details = [selection.format_selection("defaults", info.defaults())]
        details += [f"cite {info.cite}"] if info.cite else []
        details += [
            name.replace("_", " ") for name in ("robust", "certifies", "depends_on_labels") if info.facts.get(name)
        ]
        details += [f"uses {', '.join(info.facts['uses'])}"] if info.facts.get("uses") else []
        if info.facts.get("max_cameras"):
            details.append(f"up to {info.facts['max_cameras']} cameras")
        typer.echo(f"{'':<16}   {'; '.join(details)}")
    for why in found.broken.values():
        typer.echo(f"broken: {why}")
