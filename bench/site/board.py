"""The leaderboard over several tables: the rows of a report's, each with its suite, version and run."""

from collections.abc import Sequence
from typing import Any

from bench.reporting.html.leaderboard import COLUMNS, CONSTANT, Column, packed, rows_of
from bench.reporting.html.section import anchor
from bench.site.committed import Committed

ADDED = (
    Column("suite", "Suite", "text", "What was compared"),
    Column("version", "Version", "text", "Of the benchmark, and the day of the run"),
    Column("run", "Run", "text", "What made the number: its command, machine and packages"),
)
RUNS = "runs.html"


def method_pages(tables: Sequence[Committed]) -> dict[str, str]:
    """Path of the page of each method, from the root of the site; names may differ in signs that no path can hold."""
    found: dict[str, str] = {}
    for method in dict.fromkeys(name for table in tables for name in table.results.frame["method"]):
        path, k = f"methods/{anchor(method)}.html", 1
        while path in found.values():
            k += 1
            path = f"methods/{anchor(method)}-{k}.html"
        found[method] = path
    return found


def run_link(committed: Committed) -> str:
    """Link from the root of the site to what made a table."""
    return f"{RUNS}#{anchor('run', committed.name)}"


def board(tables: Sequence[Committed]) -> dict[str, Any]:
    """Columns and rows as the page reads them, with the links of their methods and runs.

    Ranks and stars are those within a table: what was not run together is not compared.
    """
    rows = [row | _place(table) for table in tables for row in rows_of(table.results)]
    pages = method_pages(tables)
    labels = dict.fromkeys(row["method"] for row in rows)
    names = {text: pages[name] for text in labels if (name := text.partition("[")[0]) in pages}
    links = {"method": names, "run": {table.name: run_link(table) for table in tables}}
    return packed((*COLUMNS, *ADDED), rows, (*CONSTANT[:1], "suite", "version")) | {"links": links}


def _place(table: Committed) -> dict[str, str]:
    return {"suite": table.provenance.suite, "version": table.release, "run": table.name}
