"""The method that is recommended: the quickest of those that do as well as the best, as far as anyone can tell."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bench.core.outcome import OK
from bench.plugins.selection import label
from bench.reporting.tables.standing import geometric_mean
from bench.scoring.results import CONFIGURED, Configured

if TYPE_CHECKING:
    import pandas as pd

MARGIN = 1.05  # the ratio of errors up to which the quicker method is preferred; that of `bench.scoring.contest`


@dataclass(frozen=True)
class Figure:
    """A quantity over the graphs that it was measured on: the middle (geometric mean), the least and the largest."""

    middle: float
    low: float
    high: float


@dataclass(frozen=True)
class Candidate:
    """What a configured method did.

    Parameters
    ----------
    method
        Name and parameters.
    median, mean
        Errors of the cameras, degrees.
    seconds
        Time of solving; a middle alone says how quick it is.
    ended
        Share of the graphs on which it ended well.
    tied
        Whether it cannot be told apart from the best.
    """

    method: Configured
    median: Figure
    mean: Figure
    seconds: Figure
    ended: float
    tied: bool

    @property
    def name(self) -> str:
        """As a selection."""
        return label(*self.method)


@dataclass(frozen=True)
class Choice:
    """Candidates, the best first, and which of them is recommended."""

    candidates: tuple[Candidate, ...]
    recommended: Candidate

    @property
    def best(self) -> Candidate:
        """The first, told apart from others or not."""
        return next(one for one in self.candidates if one.tied)

    @property
    def tied(self) -> tuple[Candidate, ...]:
        """The others that cannot be told apart from the best."""
        return tuple(one for one in self.candidates if one.tied and one != self.recommended)

    @property
    def behind(self) -> Candidate | None:
        """The next that can be told apart."""
        return next((one for one in self.candidates if not one.tied), None)


def choose(frame: "pd.DataFrame", tied: Collection[Configured]) -> Choice:
    """The quickest of the methods that are tied with the best and have errors within `MARGIN` of its own.

    A tie among a few graphs is wide, and what cannot be told apart may still be expected to be worse: it is told as a
    tie, but not recommended for being quick.

    Parameters
    ----------
    frame
        Scored rows, see `bench.scoring.results.Results.frame`.
    tied
        Which cannot be told apart from the best.
    """
    found = sorted(_candidates(frame, tied), key=lambda one: one.median.middle)
    equal = [one for one in found if one.tied]
    best = equal[0]
    near = [
        one
        for one in equal
        if one.median.middle <= MARGIN * best.median.middle and one.mean.middle <= MARGIN * best.mean.middle
    ]
    return Choice(tuple(found), min(near, key=lambda one: one.seconds.middle))


def first(frame: "pd.DataFrame", tied: Collection[Configured], order: Sequence[Configured]) -> Choice:
    """The first in an order, however quick: on graphs that are unlike each other, equal middles are no equal errors.

    Parameters
    ----------
    frame, tied
        As of `choose`.
    order
        From the best on.
    """
    by_method = {one.method: one for one in _candidates(frame, tied)}
    found = tuple(by_method[method] for method in order)
    return Choice(found, found[0])


def _candidates(frame: "pd.DataFrame", tied: Collection[Configured]) -> list[Candidate]:
    groups = frame.groupby(list(CONFIGURED), sort=False)
    return [_candidate((str(method), str(params)), rows, tied) for (method, params), rows in groups]


def _candidate(method: Configured, rows: "pd.DataFrame", tied: Collection[Configured]) -> Candidate:
    well = rows[rows["outcome"] == OK]
    median, mean, seconds = (_figure(well[name]) for name in ("median_deg", "mean_deg", "solve_s"))
    return Candidate(method, median, mean, seconds, len(well) / len(rows), method in tied)


def _figure(values: "pd.Series[float]") -> Figure:
    known = values.to_numpy(dtype=float)
    known = known[np.isfinite(known)]
    if not len(known):
        return Figure(*[float("inf")] * 3)
    return Figure(geometric_mean(known), float(known.min()), float(known.max()))
