"""A method against a recipe that takes too long to run: its time extrapolated, its best errors on file."""

import csv
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from bench.core.errors import InputError
from bench.papers.computed import Computed, label
from bench.papers.item import Comparison, MeasuredItem
from bench.papers.published import Sources
from bench.plugins import selection
from bench.scoring.metrics.oracle import ORACLE
from bench.suite.experiment import Suite

if TYPE_CHECKING:
    from bench.reporting.tables.grid import Grid


@dataclass(frozen=True)
class Speedup(MeasuredItem):
    """Layout of such a comparison.

    Parameters
    ----------
    dataset
        Selection of one instance.
    method
        What is compared with the recipe.
    recipe, iterations
        The recipe, selected with few iterations and at least two checkpoints, and how many it asks for.
    curves, chosen
        File of errors along the recipe's iterations, in ``results/reference``, and the values that some of its columns
        have for this recipe; it has the columns ``iteration, mean_deg, median_deg`` besides.
    """

    dataset: str
    method: str
    recipe: str
    iterations: int
    curves: str
    chosen: Mapping[str, int]

    needs: ClassVar[Collection[str]] = ("checkpoints",)

    def suites(self, name: str) -> tuple[Suite, ...]:
        """What has to run; the two methods one after the other, on the same data."""
        return (self.suite(name, [self.dataset], [self.method, self.recipe]),)

    def verify(self, sources: Sources) -> None:
        """Check that `curves` has the errors of the recipe."""
        self._oracle(sources.reference)

    def compare(self, sources: Sources, computed: Computed) -> "Ratio":
        """Time and errors of the method, of the recipe, and their ratio; nothing where the data are not on disk.

        The recipe's total is its measured time for an iteration times `iterations`; its errors are those of the iterate
        that ground truth likes best in `curves`.

        Raises
        ------
        InputError
            Where the recipe gave no checkpoints, or `curves` has no such rows.
        """
        oracle = self._oracle(sources.reference)
        method, recipe = label("method", self.method), label("method", self.recipe)
        first = next((score for score in computed.scores if score.ok and score.method == method), None)
        if first is None:
            return Ratio(self, (), computed)
        rate = self._seconds_an_iteration(computed, recipe)
        total = rate * self.iterations
        rows = (
            Side(
                method,
                int(first.iterations),
                first.solve_s / first.iterations,
                first.solve_s,
                first.mean_deg,
                first.median_deg,
                total / first.solve_s,
            ),
            Side(recipe, self.iterations, rate, total, float(oracle["mean_deg"]), float(oracle["median_deg"]), 1.0),
        )
        return Ratio(self, rows, computed)

    def _oracle(self, folder: Traversable) -> dict[str, str]:
        path = folder / self.curves
        if not path.is_file():
            raise InputError(f"there is no file {path} with the errors of the recipe")
        with path.open(encoding="utf-8") as file:
            rows = [
                row
                for row in csv.DictReader(file)
                if all(row.get(column) == str(value) for column, value in self.chosen.items())
            ]
        if not rows:
            raise InputError(f"{path} has no rows with {selection.format_parameters(self.chosen)}")
        return min(rows, key=lambda row: float(row["mean_deg"]))

    def _seconds_an_iteration(self, computed: Computed, recipe: str) -> float:
        curves = computed.curves.get(recipe)
        if not curves or len(curves[0].seconds) < 2:
            raise InputError(f"'{self.recipe}' gave no two checkpoints to take a rate from")
        return float(np.diff(curves[0].seconds).sum() / np.diff(curves[0].iterations).sum())


@dataclass(frozen=True)
class Side:
    """The method, or the recipe."""

    method: str
    iterations: int
    iteration_s: float
    total_s: float
    mean_deg: float
    median_deg: float
    times_less: float


@dataclass(frozen=True)
class Ratio(Comparison):
    """The two, with the ratio of their times."""

    table: Speedup
    rows: tuple[Side, ...]
    computed: Computed

    def grid(self) -> "Grid":
        """A row for each of the two."""
        from bench.reporting.tables.grid import Cell, Grid
        from bench.reporting.tables.printed import degrees, short

        def texts(row: Side) -> tuple[str, ...]:
            times = f"{row.iterations:,}", f"{1e3 * row.iteration_s:.2f}", short(row.total_s)
            return *times, degrees(row.mean_deg), degrees(row.median_deg), short(row.times_less)

        table = self.table
        heads = ("iterations", "ms an iteration", "s in total", "mean", "median", "times less")
        return Grid(
            caption=f"{table.title}; degrees, {self.computed.alignment} alignment, {table.dataset}",
            facts=("Method",),
            methods=tuple((head, "") for head in heads),
            rows=tuple(((row.method,), tuple(map(Cell, texts(row)))) for row in self.rows),
            notes=(
                f"The recipe's time is that of an iteration, measured here, times its {table.iterations:,} iterations.",
                f"The recipe's errors are its {ORACLE}'s (the iterate that ground truth likes best), from "
                f"{table.curves}.",
                *self.computed.remarks(),
            ),
        )


ITEM = Speedup
