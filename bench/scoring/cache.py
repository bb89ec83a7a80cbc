"""The scores of stored estimates, kept beside them so that a table over a million records answers at once.

What is kept can be computed again from the records at any time. It lies in ``RUN/scores/<rule>-<version>``, a
Parquet file for every batch that was scored; the version is a hash of the scoring code, so that a changed score is
a new one everywhere. A row is used as long as its record is the file that was scored, by its time of
modification; no estimate is replaced without its record.
"""

import contextlib
import hashlib
import os
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

import bench
from bench.core.errors import InputError
from bench.core.problem import Estimate, Floats, Instance
from bench.scoring.doubts import doubts
from bench.scoring.metrics.errors import all_camera_errors
from bench.scoring.row import scored
from bench.storage.record import Record
from bench.storage.store import AGAIN, Store
from bench.suite.plan import Job

BATCH = 20_000  # rows of a file
TOGETHER = 100  # estimates in memory
READ = 4  # batches whose errors are kept in memory, for tables that ask for them row by row
INSTANCES = 8  # kept in memory; jobs come instance by instance
SOURCES = (
    "core/so3.py",
    "core/problem.py",
    "core/redundancy.py",
    "scoring/row.py",
    "scoring/doubts.py",
    "scoring/conventions/*.py",
    "scoring/metrics/alignment.py",
    "scoring/metrics/errors.py",
    "scoring/metrics/roc.py",
)

_TEXT = ("protocol", "collection", "outcome", "status", "stop_reason", "used", "offered", "notes")
_WHOLE = ("n_scored", "n_cameras", "n_edges", "n_solved", "n_checkpoints")
_NUMBERS = (
    *("mean_deg", "median_deg", "rms_deg", "p90_deg", "max_deg"),
    *("within_1_deg", "within_3_deg", "within_5_deg", "within_10_deg", "within_30_deg"),
    *("auc_1_deg", "auc_5_deg", "auc_10_deg"),
    *("solve_s", "peak_mib", "conversion_s", "roc_auc", "residual_mean_deg", "residual_median_deg"),
    *("cost_l1", "cost_l1_truth", "cost_l2", "cost_l2_truth", "edges_percent", "hardness"),
    *("cost", "certificate", "min_s", "waited"),
)
SCHEMA = pa.schema(
    [("job", pa.string()), ("stamp", pa.int64())]
    + [(name, pa.string()) for name in _TEXT]
    + [(name, pa.int64()) for name in (*_WHOLE, "iterations")]
    + [(name, pa.float64()) for name in _NUMBERS]
    + [("has_truth", pa.bool_()), ("round_s", pa.list_(pa.float64())), ("instance_notes", pa.list_(pa.string()))]
)
ERRORS = pa.field("errors", pa.list_(pa.float64()))


@dataclass(frozen=True)
class _Found:
    """What is stored of a job, with the stamp of its record."""

    job: Job
    stamp: int
    instance: Instance
    record: Record | None
    estimate: Estimate | None


@dataclass(frozen=True)
class Scores:
    """Rows of jobs, in their order, and the camera errors behind them.

    Parameters
    ----------
    table
        As `SCHEMA` says.
    unreadable
        A sentence for every record or estimate that cannot be read; such jobs count as not run.
    """

    table: pa.Table
    unreadable: tuple[str, ...]
    _parts: tuple["_Part", ...]
    _places: Any

    def where(self, mask: Any) -> "Scores":
        """Only the rows (k,) where the mask is True."""
        if mask.all():
            return self
        chosen = pa.array(np.flatnonzero(mask))
        return Scores(self.table.take(chosen), self.unreadable, self._parts, self._places[mask])

    def errors(self, rows: Any) -> list[Floats]:
        """Errors (n,) in degrees of the rows asked for; NaN where not scored, empty without ground truth."""
        wanted = self._places[rows]
        out: list[Floats] = [np.empty(0)] * len(wanted)
        offset = 0
        for part in self._parts:
            mine = np.flatnonzero((wanted >= offset) & (wanted < offset + part.table.num_rows))
            if len(mine):
                column = part.errors()
                for k in mine:
                    out[k] = column[int(wanted[k]) - offset].values.to_numpy()
            offset += part.table.num_rows
        return out


def scores_of(store: Store, jobs: Sequence[Job], rule: str) -> Scores:
    """Scores of jobs, computed where they are not kept yet, and kept where the folder can be written."""
    folder = store.folder / "scores" / f"{rule}-{_version()}"
    parts = [part for path in sorted(folder.glob("*.parquet")) if (part := _read(path))]
    ids = pa.array([job.id for job in jobs], pa.string())
    stamps = _stamps(store, jobs)
    found = _located(parts, ids, stamps)
    scorer = _Scorer(store, rule)
    todo = np.flatnonzero((found < 0) & (stamps >= 0)).tolist()
    for start in range(0, len(todo), BATCH):
        rows = scorer.rows([(jobs[k], int(stamps[k])) for k in todo[start : start + BATCH]])
        if rows:
            parts.append(_kept(_tabulated(rows), folder))
    if scorer.unreadable:
        stamps[[job.id in scorer.unreadable for job in jobs]] = -1
    absent = [(jobs[k], -1) for k in np.flatnonzero(stamps < 0).tolist()]
    if absent:
        parts.append(_Part(_tabulated(scorer.rows(absent))))
    if todo or absent:
        found = _located(parts, ids, stamps)
    table = pa.concat_tables([part.table for part in parts] or [SCHEMA.empty_table()])
    if not np.array_equal(found, np.arange(table.num_rows)):
        table = table.take(pa.array(found))
    return Scores(table, tuple(scorer.unreadable.values()), tuple(parts), found)


class _Scorer:
    def __init__(self, store: Store, rule: str) -> None:
        self.store = store
        self.rule = rule
        self.instance = lru_cache(INSTANCES)(partial(_noted, store))
        self.unreadable: dict[str, str] = {}

    def rows(self, jobs: Sequence[tuple[Job, int]]) -> list[dict[str, Any]]:
        """Score jobs, each with the stamp of its record; those whose record cannot be read are left out and told."""
        return [row for k in range(0, len(jobs), TOGETHER) for row in self._rows(jobs[k : k + TOGETHER])]

    def _rows(self, jobs: Sequence[tuple[Job, int]]) -> Iterator[dict[str, Any]]:
        read = [found for job, stamp in jobs if (found := self._read(job, stamp))]
        solved = {
            found.job.id: (found.estimate.rotations, found.instance.truth)
            for found in read
            if found.estimate is not None and found.instance.truth is not None
        }
        errors = dict(zip(solved, all_camera_errors(list(solved.values()), self.rule), strict=True))
        for found in read:
            cameras = found.instance.problem.n if found.instance.truth is not None else 0
            of_job = errors.get(found.job.id, np.full(cameras, np.nan))
            row = scored(found.instance, found.record, found.estimate, of_job)
            yield {**row, "job": found.job.id, "stamp": found.stamp}

    def _read(self, job: Job, stamp: int) -> _Found | None:
        try:
            record = self.store.record(job.id) if stamp >= 0 else None
            estimate = self.store.estimate(job.id, record) if record and record.outcome.ok else None
        except InputError as error:
            self._tell(job, str(error))
            return None
        instance = self.instance(job.instance_key)
        if estimate is not None and len(estimate.rotations) != instance.problem.n:
            self._tell(job, f"{self.store.estimate_path(job.id)} does not fit its instance; {AGAIN}")
            return None
        return _Found(job, stamp, instance, record, estimate)

    def _tell(self, job: Job, sentence: str) -> None:
        self.unreadable[job.id] = sentence


def _noted(store: Store, key: str) -> Instance:
    """An instance, with what its conventions leave to doubt among its notes."""
    instance = store.instance(key)
    return replace(instance, notes=(*instance.notes, *_doubts(store, key)))


@lru_cache(maxsize=1000)
def _doubts(store: Store, key: str) -> tuple[str, ...]:
    """Found once for all alignments."""
    return tuple(doubts(store.instance(key)))


@cache
def _version() -> str:
    """Hash of the code that scores."""
    here = Path(bench.__file__).parent
    files = [path for name in SOURCES for path in sorted(here.glob(name))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:12]


def _stamps(store: Store, jobs: Sequence[Job]) -> Any:
    """When each record was written, in nanoseconds; -1 where there is none."""
    folder = os.fspath(store.record_path("").parent)  # as text: a million paths are slow to build

    def stamp(job_id: str) -> int:
        try:
            return os.stat(f"{folder}/{job_id[:2]}/{job_id}.json").st_mtime_ns
        except FileNotFoundError:
            return -1

    return np.array([stamp(job.id) for job in jobs], dtype=np.int64)


class _Part:
    """A batch of rows; its errors stay on disk until they are asked for."""

    def __init__(self, table: pa.Table, path: Path | None = None) -> None:
        self.table = table.select(SCHEMA.names)
        self.path = path
        self.held = None if path else table.column("errors")

    def errors(self) -> pa.ChunkedArray:
        """The column of errors."""
        return self.held if self.held is not None else _errors_on_disk(self.path)


@lru_cache(maxsize=READ)
def _errors_on_disk(path: Path) -> pa.ChunkedArray:
    """The column of errors of a file, which nobody writes twice."""
    return pq.read_table(path, columns=["errors"]).column("errors")


def _read(path: Path) -> _Part | None:
    """A batch on disk; None where it cannot be read, so that its jobs are scored again."""
    try:
        return _Part(pq.read_table(path, columns=SCHEMA.names, memory_map=False).cast(SCHEMA), path)
    except (OSError, pa.ArrowException, KeyError):
        return None


def _kept(table: pa.Table, folder: Path) -> _Part:
    """A new batch, on disk where that can be written, else in memory."""
    path = folder / f"{uuid.uuid4().hex}.parquet"
    temporary = path.with_suffix(".part")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        pq.write_table(table, temporary)
        temporary.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink()
        return _Part(table)
    return _Part(table, path)


def _located(parts: Sequence[_Part], ids: pa.StringArray, stamps: Any) -> Any:
    """Where each job's row is in the parts laid end to end; -1 where there is none of today's record."""
    found = np.full(len(ids), -1)
    offset = 0
    for part in parts:
        at = pc.index_in(ids, value_set=part.table.column("job")).fill_null(-1).to_numpy()
        known = part.table.column("stamp").to_numpy()
        fits = (at >= 0) & (found < 0)
        fits[fits] = known[at[fits]] == stamps[fits]
        found[fits] = at[fits] + offset
        offset += part.table.num_rows
    return found


def _tabulated(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    return pa.Table.from_pylist(list(rows), SCHEMA.append(ERRORS))
