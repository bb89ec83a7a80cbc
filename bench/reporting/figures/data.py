"""What a figure shows, as plain numbers and looks: made once, and drawn by any painter, which knows nothing else."""

from dataclasses import dataclass
from typing import Literal

from bench.core.problem import Floats
from bench.reporting.figures.looks import Look


@dataclass(frozen=True)
class Axis:
    """What an axis is of, and its ends; no ends where categories stand on it."""

    title: str
    ends: tuple[float, float]
    log: bool = False


@dataclass(frozen=True, eq=False)
class Drawing:
    """What every figure has.

    Parameters
    ----------
    title
        Its name.
    caption
        How to read it, and what it leaves out.
    rules
        What holds for all figures of the run, for those that stand alone: alignment, protocol, scenes that are missing.
    """

    title: str
    caption: str
    rules: str


@dataclass(frozen=True, eq=False)
class Series:
    """One method, or a line that belongs to none.

    Parameters
    ----------
    look
        How it is called and drawn.
    x, y
        (k,) each.
    kind
        A line from point to point, one of steps that keep each value until the next, or points.
    named
        Whether its name stands beside its last point.
    ring
        The point that is ringed, if any.
    facts
        (k,) each: what `Chart.reading` calls ``{0}`` and ``{1}``.
    """

    look: Look
    x: Floats
    y: Floats
    kind: Literal["line", "steps", "points"] = "line"
    named: bool = False
    ring: int | None = None
    facts: tuple[Floats, ...] = ()


@dataclass(frozen=True, eq=False)
class Panel:
    """A title and what is drawn below it."""

    title: str
    series: tuple[Series, ...]


@dataclass(frozen=True, eq=False)
class Chart(Drawing):
    """Panels of series over the same axes, each of a `size` in inches.

    `reading` says a point in words, a format of ``x``, ``y`` and `Series.facts`; `ring` what a ring means.
    """

    x: Axis
    y: Axis
    panels: tuple[Panel, ...]
    reading: str
    size: tuple[float, float]
    ring: str = ""


@dataclass(frozen=True, eq=False)
class Spread:
    """The errors of one method: `QUANTILES` (5,) and the mean; none, and a remark, where it has no errors."""

    look: Look
    quantiles: Floats
    mean: float
    remark: str = ""


QUANTILES = (10, 25, 50, 75, 90)


@dataclass(frozen=True, eq=False)
class Spreads(Drawing):
    """A title and a line a method for each panel, over one axis."""

    x: Axis
    panels: tuple[tuple[str, tuple[Spread, ...]], ...]


@dataclass(frozen=True, eq=False)
class Heat(Drawing):
    """A table of coloured cells: shades (rows, columns) from 0 to 1, NaN where there is nothing, and what is written.

    `x` and `values` say what the columns and the cells (rows, columns) are.
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    x: str
    values: str
    shades: Floats
    cells: Floats
    texts: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class MeanRanks(Drawing):
    """Methods by mean rank (k,), and first and last position of the runs that are not told apart.

    A `difference` of mean ranks is critical.
    """

    methods: tuple[Look, ...]
    ranks: Floats
    groups: tuple[tuple[int, int], ...]
    difference: float
