"""Results that are kept in a repository: tables of scores, with a file that says where each comes from.

FOLDER/provenance.json     what made each table: `Provenance`
FOLDER/<name>.csv          a row a job, as ``table --format csv`` writes it
FOLDER/records.jsonl       the records behind a table, where `bench.site.export` has written it
"""

import csv
import io
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from bench.core import typed
from bench.core.errors import InputError, shown
from bench.core.outcome import Kind
from bench.reporting.tables.rows import Scene, scenes
from bench.scoring.results import CONFIGURED, PLACE, Configured, Place, Results, score
from bench.storage.record import Record
from bench.storage.store import VERSION, Store

if TYPE_CHECKING:
    import pandas as pd

PROVENANCE = "provenance.json"
SCHEMA = 1
BEST = "best"  # the column that says which rows cannot be told apart from the best
TEXTS = ("dataset", "instance", "method", "title", "params", "protocol", "alignment", "status")
WHOLE = ("seed", "n_cameras", "n_solved", "n_scored")
ANGLES = ("mean_deg", "median_deg", "solve_s")


@dataclass(frozen=True)
class Provenance:
    """Where a table comes from.

    Parameters
    ----------
    file
        The table, beside the file that says this.
    title, suite
        What was compared, and the name under which tables of several versions are shown together.
    commands
        What made it.
    finished
        The day, or the time, in ISO 8601.
    version, commit
        Of this package, and of its checkout; "" where unknown.
    machine, packages
        What it ran on, and with.
    notes
        What a reader must know.
    """

    file: str
    title: str
    suite: str
    commands: tuple[str, ...]
    finished: str
    version: str
    commit: str = ""
    machine: tuple[str, ...] = ()
    packages: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what is not the name of a file beside it, such as a path that leads out of the folder."""
        if not re.fullmatch(r"\w[\w.-]{0,99}", self.file):
            raise ValueError(f"{shown(self.file)} is not the name of a file: letters, digits, hyphens and dots")

    def to_json(self) -> dict[str, Any]:
        """As the file keeps it."""
        return asdict(self)


@dataclass(frozen=True)
class _File:
    """Content of a ``provenance.json``."""

    schema: int
    tables: tuple[Provenance, ...]


@dataclass(frozen=True)
class Committed:
    """A table of scores and where it comes from; its name is unique among those that are read together."""

    name: str
    results: Results
    provenance: Provenance

    @cached_property
    def scenes(self) -> tuple[Scene, ...]:
        """What the table says of each scene."""
        return tuple(scenes(self.results.frame, self.results.ties))

    @property
    def release(self) -> str:
        """Version and day."""
        return f"{self.provenance.version or 'unknown'} ({self.provenance.finished[:10]})"


def read_all(paths: Sequence[Path], align: str = "l1") -> list[Committed]:
    """Tables below some folders: runs, which are scored now, and committed results.

    Parameters
    ----------
    paths
        Each the folder of a run, a folder with a ``provenance.json``, or one that has such folders.
    align
        The rule under which runs are scored; committed tables are what they are.

    Raises
    ------
    InputError
        Where a folder has nothing to show, or a file cannot be read.
    """
    found: list[Committed] = []
    for path in paths:
        own = [*_read(path, align)]
        if not own:
            raise InputError(f"{path} is neither a run nor a folder of results with a {PROVENANCE}; see: export --help")
        found += own
    names = [committed.name for committed in found]
    if twice := {name for name in names if names.count(name) > 1}:
        raise InputError(f"two tables are called '{min(twice)}'; rename a folder, or name it once")
    return found


def _read(path: Path, align: str) -> Iterator[Committed]:
    if (path / VERSION).is_file():
        store = Store.open(path)
        results = score(store, align)
        yield Committed(path.name, results, provenance_of(store, results))
    elif (path / PROVENANCE).is_file():
        yield from read_folder(path)
    elif path.is_dir():
        for inner in sorted(p.parent for p in path.glob(f"*/{PROVENANCE}")):
            yield from read_folder(inner)


def read_folder(folder: Path) -> list[Committed]:
    """Tables of one folder; raises `InputError` where it, or one of them, cannot be read."""
    path = folder / PROVENANCE
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path} cannot be read: {shown(str(error), 200)}") from error
    if not isinstance(content, dict):
        raise InputError(f"{path}: not a JSON object")
    described = typed.read(_File, content, str(path))
    if described.schema != SCHEMA:
        raise InputError(f"{path}: schema {described.schema}, and this version reads {SCHEMA}")
    several = len(described.tables) > 1
    return [
        Committed(
            f"{folder.name}-{Path(one.file).stem}" if several else folder.name, read_table(folder / one.file), one
        )
        for one in described.tables
    ]


def read_table(path: Path) -> Results:
    """Scores from a CSV file; per-camera errors are not in it.

    Raises
    ------
    InputError
        Where the file is missing or not CSV, has no rows, has rows under several alignment rules, lacks a column, or a
        cell is not what its column says; with the line.
    """
    import pandas as pd

    try:
        rows = list(csv.reader(io.StringIO(path.read_text(encoding="utf-8"), newline=""), strict=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} is not a CSV file that can be read: {shown(str(error), 200)}") from error
    head = rows[0] if rows else []
    for column in (*TEXTS, *WHOLE, *ANGLES):
        if head.count(column) != 1:
            raise InputError(f"{path}:1: there must be one column '{column}', and there are {head.count(column)}")
    body = [(line, cells) for line, cells in enumerate(rows[1:], 2) if cells]
    if not body:
        raise InputError(f"{path} has no rows")
    for line, cells in body:
        _check(path, line, head, cells)
    frame = pd.DataFrame([cells for _, cells in body], columns=head)
    frame["seed"] = frame["seed"].astype("int64")
    if "timing" in head:
        frame["timing"] = frame["timing"] == "True"
    frame["outcome"] = frame["status"].str.partition("(")[0]
    if "instance_key" not in head:
        frame["instance_key"] = frame["instance"]
    rules = sorted(set(frame["alignment"]))
    if len(rules) > 1:
        raise InputError(f"{path} has rows under several alignment rules: {', '.join(map(shown, rules))}")
    return Results(frame, {}, _ties(frame), (), rules[0], {})


def _check(path: Path, line: int, head: Sequence[str], cells: Sequence[str]) -> None:
    if len(cells) != len(head):
        raise InputError(f"{path}:{line}: {len(cells)} cells where there are {len(head)} columns")
    row = dict(zip(head, cells, strict=True))
    for column in WHOLE:
        empty = not row[column] and column != "seed"
        if not empty and not (row[column].isdecimal() and len(row[column]) < 10):
            raise InputError(f"{path}:{line}: {shown(row[column])} in column '{column}' is not a whole number")
    for column in ANGLES:
        if row[column] and not _is_finite(row[column]):
            raise InputError(f"{path}:{line}: {shown(row[column])} in column '{column}' is not a number")
    if row["status"].partition("(")[0] not in get_args(Kind):
        raise InputError(f"{path}:{line}: {shown(row['status'])} is not how a job can end")


def _is_finite(text: str) -> bool:
    try:
        return bool(np.isfinite(float(text)))
    except ValueError:
        return False


def _ties(frame: "pd.DataFrame") -> dict[Place, set[Configured]]:
    """What the column `BEST` says, where there is one."""
    found: dict[Place, set[Configured]] = {}
    if BEST in frame:
        for *place, method, params in frame.loc[frame[BEST] == "True", [*PLACE, *CONFIGURED]].itertuples(index=False):
            found.setdefault(tuple(place), set()).add((method, params))
    return found


def provenance_of(store: Store, results: Results, file: str = "scores.csv") -> Provenance:
    """What the records of a run say of where its table comes from."""
    plans = store.plans()
    records = [record for job in results.frame["job"] if (record := store.record(job)) is not None]
    last = max((record.finished for record in records), default="")
    return Provenance(
        file,
        title=" and ".join(dict.fromkeys(plan.suite for plan in plans)),
        suite=plans[-1].suite,
        commands=tuple(dict.fromkeys(plan.command for plan in plans)),
        finished=last,
        version=" and ".join(_facts(records, "bench")),
        commit=" and ".join(_facts(records, "git")),
        machine=tuple(value for name in ("cpu", "platform", "python") for value in _facts(records, name)),
        packages=tuple(dict.fromkeys(f"{n} {v}" for record in records for n, v in sorted(record.versions.items()))),
        notes=results.footnotes,
    )


def _facts(records: Sequence[Record], name: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(filter(None, (record.provenance.get(name, "") for record in records))))
