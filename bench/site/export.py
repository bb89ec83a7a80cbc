"""From a run to a folder that a repository can keep: its scores, where they come from, and its records."""

import json
from dataclasses import replace
from pathlib import Path

from bench.core.errors import InputError
from bench.reporting.tables.intervals import with_intervals
from bench.scoring.results import CONFIGURED, PLACE, Results
from bench.site.committed import BEST, PROVENANCE, SCHEMA, provenance_of
from bench.storage.record import Record
from bench.storage.store import Store, write_json

SCORES = "scores.csv"
RECORDS = "records.jsonl"
PRIVATE = ("host",)  # of the provenance of a record, what stays on the machine


def export(store: Store, results: Results, folder: Path, title: str = "") -> list[Path]:
    """Write ``scores.csv``, ``provenance.json`` and ``records.jsonl``; estimates and instances stay in the run.

    Parameters
    ----------
    store, results
        The run, and its scores under the rule that is kept.
    folder
        New, or one that an export of this run has written before.
    title
        What was compared, in words; by default the name of the suite.

    Raises
    ------
    InputError
        Where the folder has other tables.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if others := sorted(path.name for path in folder.glob("*.csv") if path.name != SCORES):
        raise InputError(f"{folder} has a table already ({others[0]}); choose another folder with --into")
    provenance = provenance_of(store, results, SCORES)
    if title:
        provenance = replace(provenance, title=title)
    frame = with_intervals(results.frame, results.job_errors)
    rows = frame[[*PLACE, *CONFIGURED]].itertuples(index=False)
    frame[BEST] = [(method, params) in results.ties.get((d, i, p), ()) for d, i, p, method, params in rows]
    paths = [folder / name for name in (SCORES, PROVENANCE, RECORDS)]
    frame.to_csv(paths[0], index=False, lineterminator="\n")
    write_json(paths[1], {"schema": SCHEMA, "tables": [provenance.to_json()]})
    records = (record for job in frame["job"] if (record := store.record(job)) is not None)
    paths[2].write_text("".join(map(_line, records)), encoding="utf-8")
    return paths


def _line(record: Record) -> str:
    public = {name: fact for name, fact in record.provenance.items() if name not in PRIVATE}
    return json.dumps(replace(record, provenance=public).to_json(), ensure_ascii=False) + "\n"
