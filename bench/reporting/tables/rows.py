"""What a table says of each scene: one entry for each configured method, its seeds drawn together."""

import math
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Set
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from bench.core import outcome
from bench.reporting import appearance
from bench.scoring.inference.statistics import seed_half_width
from bench.scoring.results import Configured, Place

Ties = Mapping[Place, Set[Configured]]

OK = outcome.OK
BUSY = 0.05  # of the time of a solution spent waiting for the core, from which on a table says so
TIE_LEGEND = (
    "not told apart from the best median, nor by the mean (paired bootstrap over cameras and seeds, level 5 %, "
    "all pairs corrected; cameras of a scene are correlated)"
)


@dataclass(frozen=True)
class Value:
    """Mean over the seeds that ended well, and the half-width of its 95 % t interval (NaN for one seed)."""

    mean: float
    half_width: float = math.nan

    @property
    def known(self) -> bool:
        """Whether there is a number."""
        return math.isfinite(self.mean)


@dataclass(frozen=True)
class Failed:
    """How seeds ended that did not end well: the bare outcome, the status with its reason, and how many did."""

    outcome: str
    status: str
    seeds: int


@dataclass(frozen=True)
class Entry:
    """A configured method on a scene.

    Parameters
    ----------
    method, title, params
        Its id, its name in words and the parameters given, as text.
    values
        By column of the frame.
    solved, scored
        Cameras, rounded mean over the seeds that ended well.
    seeds, ok
        How many were planned and how many ended well.
    failures
        Every status other than ok.
    notes
        What the method or the harness noted, such as fallbacks.
    best
        Whether it cannot be told apart from the best.
    """

    method: str
    title: str
    params: str
    values: Mapping[str, Value]
    solved: int
    scored: int
    seeds: int
    ok: int
    failures: tuple[Failed, ...]
    notes: tuple[str, ...]
    best: bool

    @property
    def key(self) -> Configured:
        """The configured method."""
        return self.method, self.params

    @property
    def label(self) -> str:
        """The selection that runs it, ``shonan[loss=huber]``, or the name that a style file gives it."""
        return appearance.current().called(self.method, self.params)

    @property
    def outcomes(self) -> tuple[str, ...]:
        """The outcomes other than ok, each once."""
        return tuple(dict.fromkeys(failed.outcome for failed in self.failures))

    def value(self, name: str) -> Value:
        """What a column of the frame says of it, unknown where there is none."""
        return self.values.get(name, Value(math.nan))

    @property
    def failure(self) -> str:
        """Every status other than ok, with how many seeds it took where there are several."""
        if self.seeds == 1:
            return "; ".join(failed.status for failed in self.failures)
        return "; ".join(f"{failed.status} ({failed.seeds} of {self.seeds} seeds)" for failed in self.failures)


@dataclass(frozen=True)
class Scene:
    """An instance under a protocol and an alignment rule, with its entries in the order of the frame."""

    dataset: str
    instance: str
    protocol: str
    alignment: str
    cameras: int
    edges_percent: float
    hardness: float
    entries: tuple[Entry, ...]

    @property
    def place(self) -> Place:
        """Where its errors are found."""
        return self.dataset, self.instance, self.protocol

    def entry(self, method: Configured) -> Entry | None:
        """What a configured method did on it, if it was planned."""
        return next((e for e in self.entries if e.key == method), None)

    @property
    def has_truth(self) -> bool:
        """Whether any entry was scored; True where nothing ended well, because that is not known then."""
        return any(e.scored for e in self.entries) or not any(e.ok for e in self.entries)

    @property
    def has_roc(self) -> bool:
        """Whether the edge weights of any entry could be held against the true outliers."""
        return any(e.value("roc_auc").known for e in self.entries)


_VALUES = (
    "mean_deg",
    "median_deg",
    "p90_deg",
    "within_5_deg",
    "within_10_deg",
    "auc_1_deg",
    "auc_5_deg",
    "auc_10_deg",
    "solve_s",
    "peak_mib",
    "residual_mean_deg",
    "residual_median_deg",
    "min_s",
    "speedup",
    "speedup_low",
    "speedup_high",
    "roc_auc",
)
_NUMERIC = (*_VALUES, "n_cameras", "n_solved", "n_scored", "edges_percent", "hardness")
SEEDS_LEGEND = "means over the seeds that ended well, ± half-width of the 95 % t interval over seeds"
HARDNESS_LEGEND = (
    "hardness: second smallest eigenvalue of the graph's Laplacian over the number of cameras; lower is harder, "
    "0 is not connected"
)
ROC_LEGEND = "area under the ROC curve of a method's edge weights against the true outliers; 1 tells all of them apart"


def scenes(frame: pd.DataFrame, ties: Ties) -> list[Scene]:
    """Group scored rows, keeping their order."""
    out = []
    frame = frame.assign(**{name: pd.to_numeric(frame[name], errors="coerce") for name in _NUMERIC if name in frame})
    for (dataset, instance, protocol, alignment), rows in _groups(
        frame, ["dataset", "instance", "protocol", "alignment"]
    ):
        tied = ties.get((dataset, instance, protocol), frozenset())
        entries = tuple(_entry(group, tied) for _, group in _groups(rows, ["method", "title", "params"]))
        out.append(
            Scene(
                dataset,
                instance,
                protocol,
                alignment,
                cameras=_whole(rows["n_cameras"]),
                edges_percent=_first(rows, "edges_percent"),
                hardness=_first(rows, "hardness"),
                entries=entries,
            )
        )
    return out


def _entry(rows: pd.DataFrame, tied: Set[Configured]) -> Entry:
    method, title, params = (str(rows[name].iloc[0]) for name in ("method", "title", "params"))
    well = rows["outcome"] == OK
    ok, failed = rows[well], Counter(zip(rows.loc[~well, "outcome"], rows.loc[~well, "status"], strict=True))
    notes = rows["notes"].fillna("") if "notes" in rows else pd.Series(dtype=str)
    return Entry(
        method,
        title,
        params,
        values={name: _value(ok[name]) for name in _VALUES if name in rows},
        solved=_whole(ok["n_solved"]),
        scored=_whole(ok["n_scored"]),
        seeds=len(rows),
        ok=len(ok),
        failures=tuple(Failed(str(kind), str(status), seeds) for (kind, status), seeds in failed.items()),
        notes=tuple(dict.fromkeys(note for note in map(str, notes) if note)),
        best=(method, params) in tied,
    )


def _groups(frame: pd.DataFrame, columns: list[str]) -> Iterator[tuple[tuple[Any, ...], pd.DataFrame]]:
    groups: Any = frame.groupby(columns, sort=False, dropna=False)
    key: Hashable
    for key, rows in groups:
        yield tuple(key), rows  # type: ignore[arg-type]


def _value(column: pd.Series) -> Value:
    numbers = _numbers(column)
    return Value(_mean(numbers), seed_half_width(numbers))


def _whole(column: pd.Series) -> int:
    numbers = _numbers(column)
    return round(_mean(numbers)) if numbers else 0


def _first(rows: pd.DataFrame, column: str) -> float:
    numbers = _numbers(rows[column]) if column in rows else []
    return numbers[0] if numbers else math.nan


def _numbers(column: pd.Series) -> list[float]:
    numbers = column.to_numpy(dtype=float)
    return numbers[~np.isnan(numbers)].tolist()


def _mean(numbers: list[float]) -> float:
    return math.fsum(numbers) / len(numbers) if numbers else math.nan


def is_timed(frame: pd.DataFrame) -> bool:
    """Whether the rows are those of a timing run: the optional column ``timing`` is True on them."""
    return "timing" in frame and bool(frame["timing"].all())


def times_note(frame: pd.DataFrame) -> str:
    """How the times were taken."""
    if not is_timed(frame):
        return "times from a packed accuracy run"
    note = "times from a timing run, one job at a time on one core"
    if "speedup" not in frame:
        return note
    rounds, baseline = (" and ".join(dict.fromkeys(map(str, frame[name]))) for name in ("rounds", "baseline"))
    waited = pd.to_numeric(frame["waited"], errors="coerce").max()
    busy = f"; the machine was busy: up to {100 * waited:.0f} % of a time went by waiting for the core"
    return (
        f"{note}: median and least of {rounds} rounds in which the methods took turns, and how many times faster "
        f"than {baseline} (ratio of the medians, least to greatest ratio of a round){busy if waited > BUSY else ''}"
    )
