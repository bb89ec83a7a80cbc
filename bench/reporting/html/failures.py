"""Every job that did not end well, with its reason and the end of what it printed; and what methods noted."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from bench.core.outcome import OK
from bench.plugins.selection import label
from bench.reporting.tables.rows import Scene
from bench.storage.store import Store

LOG_LENGTH = 1500  # characters of a log that are shown


@dataclass(frozen=True)
class Failure:
    """Jobs of one configured method that ended alike.

    Parameters
    ----------
    method, status
        The selection that runs it, and how the jobs ended.
    where
        Scenes, with the seeds where there are several.
    log
        The end of what the first of them printed that printed anything.
    """

    method: str
    status: str
    where: tuple[str, ...]
    log: str


def failures(store: Store, frame: pd.DataFrame) -> list[Failure]:
    """Failures in the order of the frame, those of one method with the same status together."""
    several = frame["seed"].nunique() > 1
    found = []
    for (method, params, status), rows in frame[frame["outcome"] != OK].groupby(
        ["method", "params", "status"], sort=False
    ):
        where = [
            f"{instance}, seed {seed}" if several else str(instance)
            for instance, seed in zip(rows["instance"], rows["seed"], strict=True)
        ]
        logs = (record.log.strip() for job in rows["job"] if (record := store.record(job)))
        log = next(filter(None, logs), "")[-LOG_LENGTH:]
        found.append(Failure(label(str(method), str(params)), str(status), tuple(dict.fromkeys(where)), log))
    return found


def notes(scenes: Sequence[Scene]) -> list[tuple[str, str, str]]:
    """Method, scenes and note, for each thing that a method or the harness noted."""
    found: dict[tuple[str, str], list[str]] = {}
    for scene in scenes:
        for entry in scene.entries:
            for note in entry.notes:
                found.setdefault((entry.label, note), []).append(scene.instance)
    return [(method, ", ".join(dict.fromkeys(where)), note) for (method, note), where in found.items()]
