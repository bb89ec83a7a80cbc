"""Every choice toggled, one at a time: which switch moves a measured number closest to the published one?"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bench.papers.explain.measure import CHOICES, Answer, Measure
from bench.papers.item import Comparison

if TYPE_CHECKING:
    from bench.reporting.tables.grid import Grid

NOTICED_DEG = 1e-4  # a gap that shrinks by less has not been closed


@dataclass(frozen=True)
class Setting:
    """All that a measured number depends on: a method's selection, a protocol and how errors become a number."""

    method: str
    protocol: str
    measure: Measure


@dataclass(frozen=True)
class Switch:
    """One choice, as it is and as it could be; the setting differs in nothing else."""

    name: str
    before: str
    after: str
    setting: Setting


@dataclass(frozen=True)
class Tried:
    """What one switch makes of a cell: degrees as measured and as published, and their gaps."""

    switch: str
    before: str
    after: str
    measured: float
    published: str
    difference: float
    gap_before: float
    gap_after: float
    status: str


@dataclass(frozen=True)
class Explained(Comparison):
    """One cell, bisected.

    Parameters
    ----------
    scene, column
        The cell.
    published, measured
        As printed, and ours in degrees.
    alignment
        The rule that ours is measured by.
    rows
        Every single switch.
    """

    scene: str
    column: str
    published: str
    measured: float
    alignment: str
    rows: tuple[Tried, ...]

    @property
    def gap(self) -> float:
        """How far we are from what is published, in degrees."""
        return abs(self.measured - float(self.published))

    @property
    def closest(self) -> Tried | None:
        """The switch that leaves the smallest gap; None where none gave a number."""
        reached = [row for row in self.rows if math.isfinite(row.gap_after)]
        return min(reached, key=lambda row: row.gap_after, default=None)

    def grid(self) -> "Grid":
        """A row for each switch, those that come closest first; the closest is bold where it helps."""
        from bench.reporting.tables.grid import ABSENT, Cell, Grid, abbreviated

        def gap(value: float) -> float:
            return value if math.isfinite(value) else math.inf

        def number(value: float, sign: str = "") -> str:
            if not math.isfinite(value):
                return ABSENT
            return f"{round(value, 3) or 0:{sign if round(value, 3) else ''}.3f}".replace("-", "−")

        def cells(row: Tried) -> tuple[Cell, ...]:
            measured = number(row.measured) if math.isfinite(row.measured) else abbreviated(row.status)
            gaps = (number(row.gap_before), number(row.gap_after), number(row.gap_after - row.gap_before, "+"))
            return Cell(measured, row.gap_after == closest < row.gap_before), *map(Cell, gaps)

        rows = sorted(self.rows, key=lambda row: gap(row.gap_after))
        closest = min((gap(row.gap_after) for row in rows), default=math.inf)
        return Grid(
            caption=f"{self.scene} / {self.column}: measured {self.measured:.3f} ({self.alignment} alignment), "
            f"published {self.published}; every row changes one thing",
            facts=("switch", "from", "to"),
            methods=(("measured", ""), ("gap before", ""), ("gap after", ""), ("change", "")),
            rows=tuple(((row.switch, row.before, row.after), cells(row)) for row in rows),
            notes=(self.sentence(),),
        )

    def sentence(self) -> str:
        """Which single switch moves our number closest to the published one, or that none does."""
        cell = f"{self.scene} / {self.column}"
        if not math.isfinite(self.measured):
            return f"{cell}: nothing was measured, so there is no gap to explain."
        start = f"{cell}: measured {self.measured:.3f}, published {self.published}, gap {self.gap:.3f}."
        if self._prints_alike(self.measured):
            start += " They agree in the digits that are printed."
        tried, best = f"of {len(self.rows)} single switches", self.closest
        if best is None or self.gap - best.gap_after < NOTICED_DEG:
            return f"{start} None {tried} brings them closer."
        there = "which prints as published" if self._prints_alike(best.measured) else "which is not there yet"
        return (
            f"{start} Closest, {tried}: {best.switch} {best.before} -> {best.after} gives {best.measured:.3f}, {there} "
            f"({1 - best.gap_after / self.gap:.0%} of the gap closed)."
        )

    def _prints_alike(self, value: float) -> bool:
        digits = len(self.published.partition(".")[2])
        return f"{value:.{digits}f}" == self.published


def switches(setting: Setting, methods: Sequence[str], protocols: Sequence[str]) -> Iterator[Switch]:
    """Every way to change one choice of a setting.

    Parameters
    ----------
    setting
        Where we stand.
    methods
        Selections that could stand for the same column.
    protocols
        That the dataset knows; none where it has no such parameter.
    """
    for method in methods:
        if method != setting.method:
            yield Switch("method", setting.method, method, replace(setting, method=method))
    for protocol in protocols:
        if protocol != setting.protocol:
            yield Switch("protocol", setting.protocol, protocol, replace(setting, protocol=protocol))
    for name, choices in CHOICES.items():
        before = getattr(setting.measure, name)
        for choice in choices:
            if choice != before:
                measure = replace(setting.measure, **{name: choice})
                yield Switch(name, before, choice, replace(setting, measure=measure))


def explain(
    scene: str,
    column: str,
    published: str,
    setting: Setting,
    tried: Sequence[Switch],
    answers: Callable[[str, str], tuple[Sequence[Answer], str]],
) -> Explained:
    """Measure a cell as it stands and under every switch; nothing is run.

    Parameters
    ----------
    scene, column, published
        The cell, and its number as printed.
    setting, tried
        How we measure it, and what could be otherwise.
    answers
        Gives, for a method and a protocol, an estimate with its instance for each seed that ended well, and a status.
    """
    ours = setting.measure.of(answers(setting.method, setting.protocol)[0])
    target = float(published)
    rows = []
    for switch in tried:
        found, status = answers(switch.setting.method, switch.setting.protocol)
        if _applies(switch, found):
            value = switch.setting.measure.of(found)
            gaps = value - target, abs(ours - target), abs(value - target)
            rows.append(Tried(switch.name, switch.before, switch.after, value, published, *gaps, status))
    return Explained(scene, column, published, ours, setting.measure.alignment, tuple(rows))


def _applies(switch: Switch, answers: Sequence[Answer]) -> bool:
    """A pick among checkpoints needs some, one among seeds needs several."""
    if switch.name == "checkpoint":
        return any(estimate.checkpoints for estimate, _ in answers)
    return switch.name != "seeds" or len(answers) > 1


def together(explained: Sequence[Explained]) -> Iterator[str]:
    """For each column of which several cells were explained, the switch that leaves the smallest gap over all of them.

    What closes one gap may do so by chance, and open the others.
    """
    for column in dict.fromkeys(one.column for one in explained):
        own = [one for one in explained if one.column == column and math.isfinite(one.measured)]
        if len(own) < 2:
            continue
        gaps: dict[tuple[str, str, str], list[float]] = {}
        for row in (row for one in own for row in one.rows if math.isfinite(row.gap_after)):
            gaps.setdefault((row.switch, row.before, row.after), []).append(row.gap_after)
        means = {switch: float(np.mean(left)) for switch, left in gaps.items() if len(left) == len(own)}
        before = float(np.mean([one.gap for one in own]))
        start = f"{column}, {len(own)} scenes together: mean gap {before:.3f}."
        if not means or before - min(means.values()) < NOTICED_DEG:
            yield f"{start} No single switch makes it smaller."
            continue
        (name, old, new), least = min(means.items(), key=lambda entry: entry[1])
        yield f"{start} The switch that leaves least: {name} {old} -> {new}, {least:.3f}."
