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

    `reading` says a point in words, a format of ``x``, ``y`` and `Series.facts` with d3's specifiers (``~r`` writes no
    exponent); `ring` what a ring means.
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


@dataclass(frozen=True)
class Leader:
    """The line from a method's mean rank on the axis, at height 0, down to `y` and out to `end`, where its name is."""

    look: Look
    rank: float
    y: float
    end: float
    left: bool

    @property
    def text(self) -> str:
        """What stands at its end."""
        return f"{self.look.label}  {self.rank:.2f}"


@dataclass(frozen=True)
class Bar:
    """A bar over the mean ranks of methods that are not told apart, at a height."""

    low: float
    high: float
    y: float


LANE = 0.6  # height of a bar's place, in lines of names
RULER = 1.7  # above the axis: the bar that is as long as the critical difference
BAR_BEYOND = 0.06  # ranks by which a bar reaches beyond the methods that it joins


@dataclass(frozen=True, eq=False)
class MeanRanks(Drawing):
    """Methods by mean rank (k,), and first and last position of the runs that are not told apart (Demsar 2006).

    A `difference` of mean ranks is critical. What the diagram is made of is placed here, once for all painters: an axis
    from rank 1 to k at height 0, bars below it, then a line of names each, the better half at the left.
    """

    methods: tuple[Look, ...]
    ranks: Floats
    groups: tuple[tuple[int, int], ...]
    difference: float

    @property
    def ends(self) -> tuple[float, float]:
        """The best and the worst rank."""
        return 1.0, float(len(self.methods))

    @property
    def depth(self) -> float:
        """Height from the axis down to below the last name, in lines."""
        return (len(self.methods) + 1) // 2 + LANE * len(self.groups) + 0.8

    @property
    def ruler(self) -> tuple[float, float]:
        """Ends of the bar as long as the critical difference, which is cut off at the worst rank."""
        best, worst = self.ends
        return best, min(best + self.difference, worst)

    @property
    def bars(self) -> tuple[Bar, ...]:
        """One for each group."""
        return tuple(
            Bar(float(self.ranks[first]) - BAR_BEYOND, float(self.ranks[last]) + BAR_BEYOND, -0.55 - LANE * lane)
            for lane, (first, last) in enumerate(self.groups)
        )

    @property
    def leaders(self) -> tuple[Leader, ...]:
        """One for each method."""
        count = len(self.methods)
        half = (count + 1) // 2
        found = []
        for position, (look, rank) in enumerate(zip(self.methods, self.ranks.tolist(), strict=True)):
            left = position < half
            level = position if left else count - 1 - position
            y = -(level + 1.0 + LANE * len(self.groups))
            found.append(Leader(look, rank, y, self.ends[0 if left else 1], left))
        return tuple(found)
