"""What every item of a paper can do, whatever its kind."""

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

from bench.core.errors import InputError
from bench.papers.computed import Computed
from bench.papers.published import Sources
from bench.suite.experiment import Suite

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from bench.reporting.tables.grid import Grid


class Comparison(ABC):
    """An item made again: what is measured beside what is published."""

    rows: Sequence[Any]  # instances of one dataclass

    def frame(self) -> "pd.DataFrame":
        """Every number, unrounded: a row for each of the rows, a column for each of their fields."""
        import pandas as pd

        return pd.DataFrame([dataclasses.asdict(row) for row in self.rows])

    @abstractmethod
    def grid(self) -> "Grid":
        """The same as a table."""

    def printed(self) -> "Grid":
        """The table in the form of the paper, where that is another."""
        return self.grid()

    def figure(self) -> "Figure | None":
        """The same as a figure, where the item is one."""
        return None

    def text(self, style: str, *, width: int = 100, terminal: bool = False) -> tuple[str, tuple[str, ...]]:
        """The table in a format, and the notes that are not in it; see `bench.reporting.tables.render.text_of`."""
        from bench.reporting.tables.render import text_of

        grid = self.printed() if style == "latex" else self.grid()
        return text_of([grid], self.frame(), style, width=width, terminal=terminal)


class Item(ABC):
    """A table, figure or claim, as a layout describes it: a frozen dataclass of its keys.

    Parameters
    ----------
    title
        What it is, in the paper's words.
    alignment
        The rule that removes the gauge; "" where nothing is scored.
    needs
        What has to be scored besides estimates: ``oracle``, ``checkpoints``.
    """

    title: str
    alignment: str
    needs: ClassVar[Collection[str]] = ()

    def verify(self, sources: Sources) -> None:  # noqa: B027
        """Check what the layout says against the published numbers, before anything runs.

        Raises
        ------
        InputError
            Where the two do not fit together.
        """

    def with_methods(self, methods: Sequence[str]) -> Self:
        """The item with further methods, which the paper has not.

        Parameters
        ----------
        methods
            Selections, each of one configuration.

        Raises
        ------
        InputError
            Where it has no place for them.
        """
        raise InputError(f"-m adds methods to a table of scenes or a figure of curves, not to “{self.title}”")

    def read_recorded(self, sources: Sources) -> "Comparison | None":
        """What was computed for it once and kept, where computing it takes hours; None where nothing is kept."""
        return None

    @abstractmethod
    def suites(self, name: str) -> Sequence[Suite]:
        """What has to run, in suites of this name."""

    @abstractmethod
    def compare(self, sources: Sources, computed: Computed) -> Comparison:
        """Put what was computed beside what is published.

        Raises
        ------
        InputError
            Where the layout and the published numbers do not fit together.
        """


@dataclass(frozen=True, kw_only=True)
class MeasuredItem(Item):
    """An item for which something has to run; `seeds`, `timeout_s` and `memory_gib` are as in a suite."""

    title: str
    alignment: str
    seeds: int = 1
    timeout_s: float = 600.0
    memory_gib: float = 8.0

    def suite(self, name: str, datasets: Iterable[str], methods: Iterable[str], seeds: int = 0) -> Suite:
        """A suite within the limits of the item, with its number of seeds where no other is given."""
        limits = seeds or self.seeds, self.timeout_s, self.memory_gib
        return Suite(name, self.title, tuple(datasets), tuple(methods), *limits)
