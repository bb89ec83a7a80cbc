"""A published table of what methods need, beside what our methods declare."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.core.errors import InputError, suggestion
from bench.papers.computed import one
from bench.plugins.catalog import catalog
from bench.suite.experiment import Suite

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class PropertyTable:
    """Layout of such a table.

    Parameters
    ----------
    title
        What the table is.
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

    def suites(self, name: str) -> tuple[Suite, ...]:
        """Nothing has to run."""
        return ()

    def compare(self) -> "pd.DataFrame":
        """Declared and published, one row for each method and column.

        Returns
        -------
        DataFrame
            ``name, method, property, declared, published, agree``; None where one of the two is not known.

        Raises
        ------
        InputError
            Where the layout names something unknown.
        """
        import pandas as pd

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
                values = (name, text, heading, declared, published, agree)
                rows.append(
                    dict(zip(("name", "method", "property", "declared", "published", "agree"), values, strict=True))
                )
        return pd.DataFrame(rows, dtype=object)
