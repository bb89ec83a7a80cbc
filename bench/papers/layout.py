"""Read the layout of a paper: a TOML file that says what its tables and figures hold."""

import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.core import typed
from bench.core.errors import InputError, brief, shown, suggestion
from bench.formats import toml_file
from bench.papers import kinds
from bench.papers.item import Item
from bench.papers.published import Sources
from bench.scoring.metrics.alignment import RULES

PAPERS = "bench.papers"


@dataclass(frozen=True)
class Layout:
    """A paper and the items of it that can be made again.

    Parameters
    ----------
    name, title, cite
        Its id, its title with authors and year, and its key in ``methods/references.bib``.
    items
        Tables and figures, by the names that the command line takes.
    sources
        Where its published numbers are, and our own recorded runs.
    """

    name: str
    title: str
    cite: str
    items: Mapping[str, Item]
    sources: Sources

    def item(self, name: str) -> Item:
        """One table or figure.

        Raises
        ------
        InputError
            Where the paper has no such item here.
        """
        if name not in self.items:
            raise InputError(f"paper {self.name} has no '{name}' here{suggestion(name, self.items)}")
        return self.items[name]


@dataclass(frozen=True)
class _Head:
    """What a layout says of the paper itself."""

    title: str = ""
    cite: str = ""


def paper_names() -> list[str]:
    """Names of the papers whose layouts come with the project."""
    return toml_file.names(PAPERS)


def load_layout(name: str) -> Layout:
    """Read a layout by its name, or by the path of a TOML file with its published numbers beside it.

    Raises
    ------
    InputError
        Where there is no such layout, or the file is not one.
    """
    stem, content = toml_file.read("paper", PAPERS, name)
    where = f"layout {name}"
    head = typed.read(_Head, {key: content.pop(key) for key in ("title", "cite") if key in content}, where)
    items = {key: _item(f"{where}: {brief(key)}", value) for key, value in content.items()}
    beside = Path(name).parent
    sources = Sources(beside, beside) if name.endswith(".toml") else Sources.shipped()
    return Layout(stem, head.title or stem, head.cite, items, sources)


def _item(where: str, content: Any) -> Item:
    """An item of one of the kinds, each of which is a module of `bench.papers.kinds` with its class as ``ITEM``."""
    if not isinstance(content, dict):
        raise InputError(f"{where} must be a table such as [table1], not {shown(content)}")
    names = [module.name for module in pkgutil.iter_modules(kinds.__path__)]
    kind = content.pop("kind", None)
    if kind not in names:
        raise InputError(f"{where}: kind must be one of {', '.join(names)}, not {shown(kind)}")
    item: Item = typed.read(importlib.import_module(f"{kinds.__name__}.{kind}").ITEM, content, where)
    if item.alignment not in ("", *RULES):
        raise InputError(f"{where}: alignment is {shown(item.alignment)}{suggestion(item.alignment, RULES)}")
    return item
