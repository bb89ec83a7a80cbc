"""Tables of collections: means over graphs of one kind, a line for each method."""

import math
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import chain

import numpy as np
import pandas as pd

from bench.reporting.tables.console import render_grid
from bench.reporting.tables.grid import ABSENT, Cell, Grid
from bench.reporting.tables.printed import degrees, seconds
from bench.reporting.tables.rows import TIE_LEGEND, Entry, Scene, Ties, scenes, times_note
from bench.scoring.inference.seed_ties import tied_by_seed
from bench.scoring.results import Configured

LEAST_FOR_TIES = 20  # graphs; fewer do not show how their errors vary together
_SHARES = ("within_5_deg", "within_10_deg", "auc_1_deg", "auc_5_deg", "auc_10_deg")
_SCORED = {
    "mean_deg": "mean °",
    "median_deg": "median °",
    "within_5_deg": "<5°",
    "within_10_deg": "<10°",
    "auc_1_deg": "AUC 1°",
    "auc_5_deg": "AUC 5°",
    "auc_10_deg": "AUC 10°",
}
_UNSCORED = {"residual_mean_deg": "residual mean °", "residual_median_deg": "residual median °"}
_TIME = {"solve_s": "time s"}
_FAILED = 180.0  # degrees, of a graph that a method did not solve, where methods are ranked
_LEGEND = (
    "<5° and <10°: percent of the scored cameras below; AUC: area under their recall curve up to so many degrees, in "
    "percent of what it can be"
)
_FAILURES = "a graph that a method did not solve counts as nothing there, and means of its errors are then not given"


@dataclass(frozen=True)
class Collection:
    """Graphs of one collection, or a graph that stands for itself, under a protocol and an alignment rule."""

    name: str
    scenes: tuple[Scene, ...]

    @property
    def has_truth(self) -> bool:
        """Whether errors are known; else its tables are of edge residuals."""
        return any(scene.has_truth for scene in self.scenes)

    @property
    def methods(self) -> list[Configured]:
        """Configured methods in the order of the rows."""
        return list(dict.fromkeys(entry.key for scene in self.scenes for entry in scene.entries))

    def entries(self, method: Configured) -> list[Entry]:
        """What a configured method did on each graph that it was planned on."""
        return [entry for scene in self.scenes if (entry := scene.entry(method))]


def has_collections(frame: pd.DataFrame) -> bool:
    """Whether some collection has several graphs, so that means over it are a finding."""
    if "collection" not in frame:
        return False
    named = frame[frame["collection"].fillna("") != ""]
    return bool(len(named) and named.groupby(["dataset", "collection"])["instance"].nunique().max() > 1)


def collections(frame: pd.DataFrame, ties: Ties) -> list[Collection]:
    """Scored rows by dataset, collection, protocol and alignment, in their order."""
    named = frame["collection"].fillna("") if "collection" in frame else pd.Series("", frame.index)
    of_instance = dict(zip(zip(frame["dataset"], frame["instance"], strict=True), named, strict=True))
    found: dict[tuple[str, str, str, str], list[Scene]] = {}
    for scene in scenes(frame, ties):
        name = of_instance[scene.dataset, scene.instance] or scene.instance
        found.setdefault((scene.dataset, name, scene.protocol, scene.alignment), []).append(scene)
    return [Collection(name, tuple(of)) for (_, name, _, _), of in found.items()]


def collection_table(frame: pd.DataFrame, ties: Ties) -> pd.DataFrame:
    """Unrounded means, a row for each collection and configured method, with how many graphs it ended well on."""
    rows = [
        {
            "dataset": collection.scenes[0].dataset,
            "collection": collection.name,
            "protocol": collection.scenes[0].protocol,
            "alignment": collection.scenes[0].alignment,
            "method": method[0],
            "params": method[1],
            "graphs": len(entries),
            "ended": sum(map(_ended, entries)),
            **{name: _mean(entries, name) for name in (*_SCORED, *_UNSCORED, *_TIME)},
        }
        for collection in collections(frame, ties)
        for method in collection.methods
        if (entries := collection.entries(method))
    ]
    return pd.DataFrame(rows)


def collection_grids(frame: pd.DataFrame, ties: Ties) -> list[Grid]:
    """A table for each collection: a line a method, the largest share within 10 degrees first."""
    return [_grid(collection, times_note(frame)) for collection in collections(frame, ties)]


def render_collections(frame: pd.DataFrame, ties: Ties, footnotes: Sequence[str], *, width: int, terminal: bool) -> str:
    """The tables for a terminal, footnotes at the end."""
    blocks = [render_grid(grid, width=width, terminal=terminal) for grid in collection_grids(frame, ties)]
    return "\n".join([*blocks, "".join(f"- {note}\n" for note in footnotes)])


def _grid(collection: Collection, times: str) -> Grid:
    first, count = collection.scenes[0], len(collection.scenes)
    columns = (_SCORED if collection.has_truth else _UNSCORED) | _TIME
    best = _best(collection)
    rows = [
        (_order(collection, entries), _row(entries, columns, count, method in best))
        for method in collection.methods
        if (entries := collection.entries(method))
    ]
    cameras = sorted({scene.cameras for scene in collection.scenes})
    size = f"{cameras[0]} cameras" if len(cameras) == 1 else f"{cameras[0]} to {cameras[-1]} cameras"
    of = f"means over {count} graphs of " if count > 1 else ""
    return Grid(
        caption=f"{first.dataset} / {collection.name}: {of}{size}, {first.alignment} alignment, "
        f"protocol {first.protocol}{'' if collection.has_truth else '; no ground truth: edge residuals, not errors'}",
        facts=("Method", "Graphs"),
        methods=tuple((head, "") for head in columns.values()),
        rows=tuple(row for _, row in sorted(rows, key=lambda row: row[0])),
        notes=tuple(_notes(collection, best, times)),
    )


def _row(
    entries: Sequence[Entry], columns: Mapping[str, str], count: int, best: bool
) -> tuple[tuple[str, str], tuple[Cell, ...]]:
    printed = [_printed(name, _mean(entries, name)) for name in columns]
    facts = (entries[0].label, f"{sum(map(_ended, entries))}/{count}")
    return facts, tuple(Cell(text, best and name == "median_deg") for name, text in zip(columns, printed, strict=True))


def _order(collection: Collection, entries: Sequence[Entry]) -> tuple[float, float]:
    """What rows are sorted by: the share within 10 degrees, or without truth the median residual; failures last."""
    if collection.has_truth:
        return -_mean(entries, "within_10_deg"), -_mean(entries, "auc_10_deg")
    residual = _mean(entries, "residual_median_deg")
    return residual if math.isfinite(residual) else math.inf, 0.0


def _ended(entry: Entry) -> bool:
    return entry.ok == entry.seeds


def _mean(entries: Sequence[Entry], name: str) -> float:
    """Mean over the graphs; of shares nothing where a seed did not end well, of others unknown if any did not."""
    values = [entry.value(name).mean for entry in entries]
    if name in _SHARES:
        if not any(map(math.isfinite, values)):
            return 0.0 if any(not entry.ok for entry in entries) else math.nan
        return float(np.mean([v * e.ok / e.seeds if e.ok else 0.0 for v, e in zip(values, entries, strict=True)]))
    return float(np.mean(values)) if all(map(_ended, entries)) else math.nan


def _printed(name: str, value: float) -> str:
    if name in _SHARES:
        return f"{100 * value:.1f}" if math.isfinite(value) else ABSENT
    return seconds(value) if name in _TIME else degrees(value)


def _best(collection: Collection) -> Set[Configured]:
    """Methods that cannot be told apart from the best, the graphs being the units; none where these are too few."""
    if len(collection.scenes) == 1:
        return {entry.key for entry in collection.scenes[0].entries if entry.best}
    if len(collection.scenes) < LEAST_FOR_TIES or not collection.has_truth:
        return set()
    return tied_by_seed({method: _units(collection, method) for method in collection.methods})


def _units(collection: Collection, method: Configured) -> "np.ndarray[tuple[int, int], np.dtype[np.float64]]":
    """For each graph (rows) its number, median and mean error and scored cameras."""
    rows = []
    for k, scene in enumerate(collection.scenes):
        entry = scene.entry(method)
        solved = entry is not None and _ended(entry) and entry.scored > 0
        errors = [entry.value(name).mean if entry and solved else _FAILED for name in ("median_deg", "mean_deg")]
        rows.append([k, *errors, max(e.scored for e in scene.entries)])
    return np.array(rows, dtype=np.float64)


def _notes(collection: Collection, best: Set[Configured], times: str) -> Iterator[str]:
    several = len(collection.scenes) > 1
    yield f"{'; '.join([_LEGEND] * collection.has_truth + [_FAILURES] * several + [times])}."
    if best and len(collection.scenes) > 1:
        yield (
            "Bold: not told apart from the best median, nor by the mean (over graphs as units, level 5 %, all pairs "
            "corrected)."
        )
    elif best:
        yield f"Bold: {TIE_LEGEND}."
    elif collection.has_truth:
        yield f"Fewer than {LEAST_FOR_TIES} graphs: which methods tie with the best is not told."
    for method in collection.methods:
        entries = collection.entries(method)
        failed = list(chain.from_iterable((failure.status for failure in entry.failures) for entry in entries))
        for status in dict.fromkeys(failed):
            on = f" on {failed.count(status)} of {len(collection.scenes)} graphs" if several else ""
            yield f"{entries[0].label}: {status}{on}"
