"""Read the layout of a paper: a TOML file that says what its tables and figures hold."""

import dataclasses
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from bench.core.errors import InputError, shown, suggestion
from bench.formats import toml_file
from bench.papers.items.claims import Claims
from bench.papers.items.curves import CurvePlot
from bench.papers.items.properties import PropertyTable
from bench.papers.items.scenes import SceneTable
from bench.papers.items.speedup import Speedup
from bench.scoring.metrics.alignment import RULES

Item = SceneTable | PropertyTable | CurvePlot | Claims | Speedup
PAPERS = "bench.papers"
KINDS: dict[str, type[Item]] = {
    "scenes": SceneTable,
    "properties": PropertyTable,
    "curves": CurvePlot,
    "claims": Claims,
    "speedup": Speedup,
}


@dataclass(frozen=True)
class Layout:
    """A paper and the items of it that can be made again.

    Parameters
    ----------
    name, title, cite
        Its id, its title with authors and year, and its key in ``methods/references.bib``.
    items
        Tables and figures, by the names that the command line takes.
    folder, reference
        Where its published numbers are, and our own recorded runs.
    """

    name: str
    title: str
    cite: str
    items: Mapping[str, Item]
    folder: Traversable
    reference: Traversable

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
    beside = Path(name).parent if name.endswith(".toml") else None
    folder, reference = (
        beside or resources.files(package) for package in ("bench.results.published", "bench.results.reference")
    )
    return _parsed(stem, f"layout {name}", content, folder, reference)


def _parsed(name: str, where: str, content: dict[str, Any], folder: Traversable, reference: Traversable) -> Layout:
    head = {key: content.pop(key, "") for key in ("title", "cite")}
    for key, value in head.items():
        if not isinstance(value, str):
            raise InputError(f"{where}: '{key}' must be a str, not {shown(value)}")
    items = {key: _item(f"{where}: {_brief(key)}", value) for key, value in content.items()}
    return Layout(name, head["title"] or name, head["cite"], items, folder, reference)


def _item(where: str, content: Any) -> Item:
    if not isinstance(content, dict):
        raise InputError(f"{where} must be a table such as [table1], not {shown(content)}")
    kind = content.pop("kind", None)
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError(f"{where}.kind must be one of {', '.join(KINDS)}, not {shown(kind)}")
    item = _made(KINDS[kind], content, where)
    if not isinstance(item, PropertyTable) and item.alignment not in RULES:
        raise InputError(f"{where}.alignment is {shown(item.alignment)}{suggestion(item.alignment, RULES)}")
    return item


def _made(cls: Any, content: Any, where: str) -> Any:
    """An instance of a dataclass, from the keys and values of a TOML table."""
    if not isinstance(content, dict):
        raise InputError(f"{where} must be a table, not {shown(content)}")
    fields = {f.name: f for f in dataclasses.fields(cls)}
    hints = typing.get_type_hints(cls)
    for key in content:
        if key not in fields:
            raise InputError(f"{where}: unknown key {shown(key)}{suggestion(key, fields)}")
    for key, f in fields.items():
        if key not in content and f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING:
            raise InputError(f"{where}: key '{key}' is missing")
    values = {key: _value(hints[key], value, f"{where}.{_brief(key)}") for key, value in content.items()}
    try:
        return cls(**values)
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error


def _value(hint: Any, value: Any, where: str) -> Any:
    """A TOML value as the type of a field."""
    if dataclasses.is_dataclass(hint):
        return _made(hint, value, where)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is tuple and isinstance(value, list):
        return tuple(_value(arguments[0], entry, where) for entry in value)
    if origin is Mapping and isinstance(value, dict):
        return {key: _value(arguments[1], entry, f"{where}.{_brief(key)}") for key, entry in value.items()}
    if origin is typing.Literal:
        fits, wanted = value in arguments, " or ".join(map(repr, arguments))
    else:
        accepted = {float: int | float, Mapping: dict, tuple: list}.get(origin or hint, origin or hint)
        union = hint if isinstance(hint, types.UnionType) else accepted
        fits = hint is Any or (isinstance(value, union) and (hint is bool or not isinstance(value, bool)))
        wanted = f"a {getattr(union, '__name__', union)}"
    if not fits:
        raise InputError(f"{where} must be {wanted}, not {shown(value)}")
    return value


def _brief(key: str) -> str:
    return key if key.isprintable() and len(key) <= 80 else shown(key)
