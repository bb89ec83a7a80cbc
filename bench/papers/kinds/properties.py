"""A published table of what methods need, beside what our methods declare."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.core.errors import InputError, suggestion
from bench.papers.computed import Computed, one
from bench.papers.item import Comparison, Item
from bench.papers.published import Sources
from bench.plugins.catalog import catalog
from bench.suite.experiment import Suite

if TYPE_CHECKING:
    import pandas as pd

    from bench.reporting.tables.grid import Grid


@dataclass(frozen=True)
class PropertyTable(Item):
    """Layout of such a table.

    Parameters
    ----------
    columns
        Heading of each column, and the name of the fact that a method declares.
    published
        For each method of the paper, the facts that it prints.
    declared
        For some of them, and for others, the method here that stands for it.
    """

    title: str
    columns: Mapping[str, str]
    published: Mapping[str, Mapping[str, bool]]
    declared: Mapping[str, str]

    alignment = ""

    def suites(self, name: str) -> tuple[Suite, ...]:
        """Nothing has to run."""
        return ()

    def compare(self, sources: Sources, computed: Computed) -> "Properties":
        """Declared and published, one property for each method and column.

        Raises
        ------
        InputError
            Where the layout names something unknown.
        """
        methods = catalog("method")
        rows = []
        for name in dict.fromkeys((*self.published, *self.declared)):
            text = self.declared.get(name, "")
            facts = methods[one("method", text)[0]].facts if text else {}
            for heading, fact in self.columns.items():
                if facts and fact not in facts:
                    raise InputError(f"methods declare no '{fact}'{suggestion(fact, facts)}")
                declared, published = facts.get(fact), self.published.get(name, {}).get(fact)
                agree = None if declared is None or published is None else declared == published
                rows.append(Property(name, text, heading, declared, published, agree))
        return Properties(self, tuple(rows))


@dataclass(frozen=True)
class Property:
    """A place of the table; None where one of the two is not known."""

    name: str
    method: str
    property: str
    declared: bool | None
    published: bool | None
    agree: bool | None


@dataclass(frozen=True)
class Properties(Comparison):
    """The table, filled."""

    table: PropertyTable
    rows: tuple[Property, ...]

    def frame(self) -> "pd.DataFrame":
        """A row for each `Property`; None stays None."""
        return super().frame().astype(object)

    def grid(self) -> "Grid":
        """A row for each method; declared and published side by side for each property."""
        from bench.reporting.tables.grid import ABSENT, Cell, Grid

        def cells(own: Property) -> tuple[Cell, Cell]:
            words = (ABSENT if known is None else "yes" if known else "no" for known in (own.declared, own.published))
            declared, published = (Cell(word, own.agree is False) for word in words)
            return declared, published

        rows = []
        for name in dict.fromkeys(row.name for row in self.rows):
            own = [row for row in self.rows if row.name == name]
            rows.append(((name, own[0].method or ABSENT), tuple(cell for row in own for cell in cells(row))))
        differing = any(row.agree is False for row in self.rows)
        agree = "Bold: the two differ." if differing else "What is declared here agrees with what is published."
        return Grid(
            caption=self.table.title,
            facts=("Method", "here"),
            methods=tuple((heading, kind) for heading in self.table.columns for kind in ("declared", "published")),
            rows=tuple(rows),
            notes=(agree, f"{ABSENT}: not here, or not in the paper's table."),
        )


ITEM = PropertyTable
