"""The rows of the leaderboard: every method on every scene and over all scenes, under every alignment rule."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bench.reporting.html.embed import rounded
from bench.reporting.tables.rows import Entry, Scene
from bench.reporting.tables.rows import scenes as scenes_of
from bench.reporting.tables.standing import ranks_of, standings
from bench.scoring.inference.blocks import blocks, by_scene
from bench.scoring.results import Configured, Place, Results

ALL_SCENES = "All scenes"


@dataclass(frozen=True)
class Column:
    """A column: its key, its head, how its values are written, and what it means."""

    key: str
    head: str
    kind: str  # text, deg, seconds, percent, number, count, area
    meaning: str


COLUMNS = (
    Column("method", "Method", "text", "The selection that runs it"),
    Column("scene", "Scene", "text", "Instance, or all scenes with ground truth together"),
    Column("protocol", "Protocol", "text", "Which cameras are solved and scored"),
    Column("alignment", "Alignment", "text", "The rule that removed the gauge"),
    Column(
        "rank",
        "Rank",
        "number",
        "By median error, failures last: mean over the problems of a scene, then over scenes",
    ),
    Column("median", "Median °", "deg", "Median error over the scored cameras; over all scenes the geometric mean"),
    Column("mean", "Mean °", "deg", "Mean error over the scored cameras; over all scenes the geometric mean"),
    Column("p90", "90 % °", "deg", "90th percentile of the error over the scored cameras"),
    Column("within", "< 5°", "percent", "Share of the scored cameras with an error below 5 degrees"),
    Column("within_10", "< 10°", "percent", "Share of the scored cameras with an error below 10 degrees"),
    Column("recall", "AUC 10°", "percent", "Area under the cameras' recall curve up to 10 degrees, divided by 10"),
    Column("residual", "Residual °", "deg", "Median residual of the edges; needs no ground truth and no alignment"),
    Column("auc", "AUC", "area", "Area under the ROC curve of the edge weights against the true outliers"),
    Column("time", "Time s", "seconds", "Time to solve; over all scenes the geometric mean"),
    Column("speedup", "Times faster", "number", "Than the baseline of the timing run"),
    Column("memory", "MiB", "count", "What solving added to the resident memory, at its peak"),
    Column("cameras", "Cameras", "text", "Solved / scored / all"),
    Column("best_on", "Best on", "text", "Scenes on which it is among the best"),
    Column("outcome", "Outcome", "text", "How the jobs ended"),
)
NUMBERS = {
    "median": "median_deg",
    "mean": "mean_deg",
    "p90": "p90_deg",
    "within": "within_5_deg",
    "within_10": "within_10_deg",
    "recall": "auc_10_deg",
    "residual": "residual_median_deg",
    "auc": "roc_auc",
    "time": "solve_s",
    "speedup": "speedup",
    "memory": "peak_mib",
}  # columns of a run's frame


CONSTANT = ("scene", "protocol", "alignment")  # columns that show only where their values differ


def leaderboard(by_rule: Mapping[str, Results]) -> dict[str, Any]:
    """Columns and rows as the page reads them, see `packed`."""
    return packed(COLUMNS, [row for results in by_rule.values() for row in rows_of(results)], CONSTANT)


def packed(columns: Sequence[Column], rows: Sequence[Mapping[str, Any]], constant: Sequence[str]) -> dict[str, Any]:
    """Columns and rows as the page reads them; a column that no row has a value in is left out.

    Texts are written once: a column of kind text has its ``values``, and the rows hold their numbers in it.

    Parameters
    ----------
    columns, rows
        The columns, and rows as `rows_of` gives them.
    constant
        Keys of columns that show only where their values differ.
    """
    shown = [c for c in columns if any(row.get(c.key) is not None for row in rows)]
    texts = {c.key: list(dict.fromkeys(row.get(c.key) for row in rows)) for c in shown if c.kind == "text"}
    number = {key: {value: k for k, value in enumerate(values)} for key, values in texts.items()}
    return {
        "columns": [dataclasses.asdict(c) | {"values": texts.get(c.key)} for c in shown],
        "rows": [[number[c.key][row.get(c.key)] if c.key in number else row.get(c.key) for c in shown] for row in rows],
        "best": [k for k, row in enumerate(rows) if row["best"]],
        "failed": {k: row["failed"] for k, row in enumerate(rows) if row["failed"]},
        "constant": list(constant),
    }


def rows_of(results: Results) -> Iterator[dict[str, Any]]:
    """Every method on every scene of a run, and over all of them where there are several."""
    scenes = scenes_of(results.frame, results.ties)
    ranks: dict[Place, dict[Configured, float]] = {}
    for protocol, rows in results.frame.groupby("protocol", sort=False):
        own = [scene for scene in scenes if scene.protocol == protocol]
        if len(own) > 1:
            yield from _overall(own, ranks_of(blocks(rows)))
        ranks |= {(*place, str(protocol)): ranks_of(table) for place, table in by_scene(rows).items()}
    several = len({scene.dataset for scene in scenes}) > 1
    for scene in scenes:
        name = f"{scene.dataset} / {scene.instance}" if several else scene.instance
        for entry in scene.entries:
            yield _row(scene, name, entry, ranks.get(scene.place, {}).get(entry.key))


def _overall(scenes: Sequence[Scene], ranks: Mapping[Configured, float]) -> Iterator[dict[str, Any]]:
    for standing in standings(scenes, ranks):
        yield {
            "method": standing.label,
            "scene": ALL_SCENES,
            "protocol": scenes[0].protocol,
            "alignment": scenes[0].alignment,
            "outcome": "ok" if standing.complete else f"ok on {standing.ended} of {standing.scenes}",
            "best_on": f"{len(standing.best_on)} of {standing.scenes}",
            "rank": rounded(standing.rank),
            "median": rounded(standing.median_deg),
            "mean": rounded(standing.mean_deg),
            "time": rounded(standing.seconds),
            "best": len(standing.best_on) == standing.scenes,
            "failed": standing.outcomes,
        }


def _row(scene: Scene, name: str, entry: Entry, rank: float | None) -> dict[str, Any]:
    return {key: rounded(entry.value(name).mean) for key, name in NUMBERS.items()} | {
        "method": entry.label,
        "scene": name,
        "protocol": scene.protocol,
        "alignment": scene.alignment,
        "outcome": entry.failure or "ok",
        "rank": rounded(rank) if rank is not None and entry.ok and entry.scored else None,
        "cameras": f"{entry.solved}/{entry.scored}/{scene.cameras}" if entry.ok else None,
        "best": entry.best,
        "failed": entry.outcomes,
    }
