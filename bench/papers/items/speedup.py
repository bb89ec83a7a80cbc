"""A method against a recipe that takes too long to run: its time extrapolated, its best errors on file."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from typing import TYPE_CHECKING

import numpy as np

from bench.core import outcome
from bench.core.errors import InputError
from bench.papers.computed import Computed, label, one
from bench.plugins import selection
from bench.suite.experiment import Suite

if TYPE_CHECKING:
    import pandas as pd

    from bench.scoring.results import Results


@dataclass(frozen=True)
class Speedup:
    """Layout of such a comparison.

    Parameters
    ----------
    title
        What it is.
    dataset
        Selection of one instance.
    method
        What is compared with the recipe.
    recipe, iterations
        The recipe, selected with few iterations and at least two checkpoints, and how many it asks for.
    curves, chosen
        File of errors along the recipe's iterations, in ``results/reference``, and the values that some of its columns
        have for this recipe; it has the columns ``iteration, mean_deg, median_deg`` besides.
    alignment
        The rule that removes the gauge.
    seeds, timeout_s, memory_gib
        As in a suite.
    """

    title: str
    dataset: str
    method: str
    recipe: str
    iterations: int
    curves: str
    chosen: Mapping[str, int]
    alignment: str
    seeds: int = 1
    timeout_s: float = 600.0
    memory_gib: float = 8.0

    def suites(self, name: str) -> tuple[Suite, ...]:
        """What has to run; the two methods one after the other, on the same data."""
        methods = (self.method, self.recipe)
        return (Suite(name, self.title, (self.dataset,), methods, self.seeds, self.timeout_s, self.memory_gib),)

    def compare(self, folder: Traversable, computed: Computed) -> "pd.DataFrame":
        """Time and errors of the method, of the recipe, and their ratio.

        Parameters
        ----------
        folder
            Where `curves` is.
        computed
            What was measured.

        Returns
        -------
        DataFrame
            A row for each of the two: ``method, iterations, iteration_s, total_s, mean_deg, median_deg, times_less``.
            The recipe's total is its measured time for an iteration times `iterations`; its errors are those of the
            iterate that ground truth likes best in `curves`. Empty where the data are not on disk.

        Raises
        ------
        InputError
            Where the recipe gave no checkpoints, or `curves` has no such rows.
        """
        import pandas as pd

        oracle = self._oracle(folder)
        if computed.results is None:
            return pd.DataFrame()
        frame = computed.results.frame
        name, parameters = _configured(self.method)
        own = frame[(frame["status"] == outcome.OK) & (frame["method"] == name) & (frame["params"] == parameters)]
        if own.empty:
            return pd.DataFrame()
        first = own.iloc[0]
        rate = self._seconds_an_iteration(computed.results)
        total = rate * self.iterations
        rows = [
            {
                "method": label("method", self.method),
                "iterations": first["iterations"],
                "iteration_s": first["solve_s"] / first["iterations"],
                "total_s": first["solve_s"],
                "mean_deg": first["mean_deg"],
                "median_deg": first["median_deg"],
                "times_less": total / first["solve_s"],
            },
            {
                "method": label("method", self.recipe),
                "iterations": self.iterations,
                "iteration_s": rate,
                "total_s": total,
                "mean_deg": float(oracle["mean_deg"]),
                "median_deg": float(oracle["median_deg"]),
                "times_less": 1.0,
            },
        ]
        return pd.DataFrame(rows)

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
            wanted = selection.format_parameters(dict(self.chosen))
            raise InputError(f"{path} has no rows with {wanted}")
        return min(rows, key=lambda row: float(row["mean_deg"]))

    def _seconds_an_iteration(self, results: "Results") -> float:
        key = _configured(self.recipe)
        found = [curves[0] for by_method in results.curves.values() if (curves := by_method.get(key))]
        if not found or len(found[0].seconds) < 2:
            raise InputError(f"'{self.recipe}' gave no two checkpoints to take a rate from")
        return float(np.diff(found[0].seconds).sum() / np.diff(found[0].iterations).sum())


def _configured(text: str) -> tuple[str, str]:
    name, parameters = one("method", text)
    return name, selection.format_parameters(parameters)
