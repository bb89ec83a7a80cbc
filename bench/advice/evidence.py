"""What candidates did on real graphs with truth, for graphs whose twins are not to be trusted."""

from collections.abc import Collection
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING

from bench.advice.choice import Choice, first
from bench.advice.look import Kind
from bench.core.errors import InputError
from bench.reporting.tables.collections import LEAST_FOR_TIES
from bench.scoring.inference.blocks import Blocks, Configured, blocks
from bench.scoring.inference.ranking import critical_difference

if TYPE_CHECKING:
    import pandas as pd

PACKAGE, FOLDER, FILE = "bench.results.reference", "recommend", "errors.csv"


@dataclass(frozen=True)
class Evidence:
    """What is known from other graphs.

    Parameters
    ----------
    choice
        Of the methods, by their mean ranks over the graphs; ties by Nemenyi's test.
    graphs, collections
        How many graphs, and what they are from.
    of_kind
        Whether they are all of the kind asked for.
    """

    choice: Choice
    graphs: int
    collections: tuple[str, ...]
    of_kind: bool


def kept() -> "pd.DataFrame":
    """The rows that are kept: a graph, a method, its errors in degrees; column `kind` is that of `Look`.

    `trusted` says of a graph whether its twin is.

    Raises
    ------
    InputError
        Where this installation has no such file.
    """
    import pandas as pd

    path = resources.files(PACKAGE) / FOLDER / FILE
    try:
        with path.open(encoding="utf-8") as file:
            return pd.read_csv(file, keep_default_na=False, na_values={name: [""] for name in _NUMBERS}, dtype=_TEXTS)
    except OSError as error:
        raise InputError(f"{path}: there are no results kept to recommend by") from error


_NUMBERS = ("mean_deg", "median_deg", "solve_s")
_TEXTS = {"instance": str, "params": str}


def of_other_graphs(rows: "pd.DataFrame", kind: Kind, methods: Collection[Configured]) -> Evidence:
    """What other graphs say whose twins are not to be trusted either: of one kind where there are `LEAST_FOR_TIES`.

    Parameters
    ----------
    rows
        See `kept`.
    kind
        Of the graph that is asked about.
    methods
        Those that can be recommended for it.

    Raises
    ------
    InputError
        Where nothing is known of any of them.
    """
    rows = rows[~rows["trusted"]]
    rows = rows[[one in methods for one in zip(rows["method"], rows["params"], strict=True)]]
    if rows.empty:
        raise InputError("nothing is known of how the candidates do on graphs whose twins are not to be trusted")
    of_kind = rows[rows["kind"] == kind]
    enough = of_kind["instance"].nunique() >= LEAST_FOR_TIES
    rows = of_kind if enough else rows
    order, tied = _ranked(blocks(rows))
    return Evidence(
        first(rows, tied, order),
        int(rows["instance"].nunique()),
        tuple(rows["collection"].unique()),
        bool(enough),
    )


def _ranked(table: Blocks) -> tuple[tuple[Configured, ...], tuple[Configured, ...]]:
    """Methods by mean rank, and those that cannot be told apart from the first; a single one needs no test."""
    if not table.enough:
        return table.methods, table.methods
    ranked = critical_difference(table)
    last = next((last for first, last in ranked.groups if first == 0), 0)
    return ranked.methods, ranked.methods[: last + 1]
