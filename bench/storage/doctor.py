"""Find what is damaged, missing or left over in the folder of a run, and mend what can be mended."""

import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from bench.core.errors import InputError
from bench.core.program import program
from bench.storage.store import ASIDE, Store
from bench.suite.plan import Plan


@dataclass(frozen=True)
class Finding:
    """Something that is not as it should be.

    Parameters
    ----------
    path
        Where.
    what
        A sentence.
    remedy
        What `repair` does about it: "aside" (moved to ``RUN/damaged``, so that the next run makes it again),
        "remove" (it serves nothing), "plan" (a record that no plan names is given one), "" for nothing.
    """

    path: Path
    what: str
    remedy: str


def examine(folder: Path) -> list[Finding]:
    """Read everything that a run's folder holds; nothing is changed.

    Raises
    ------
    InputError
        Where the folder is no run.
    """
    store = Store.open(folder)
    plans = _unreadable(store.folder.glob("plans/*.json"), store.plan)
    instances = _unreadable(store.folder.glob("instances/*"), lambda path: store.instance(path.name))
    return [*plans, *_records(store), *instances, *_leftovers(store)]


def repair(folder: Path, findings: list[Finding]) -> None:
    """Do what the findings' remedies say; nothing that holds a result is deleted."""
    store = Store.open(folder)
    adopted = []
    for finding in findings:
        if finding.remedy == "aside":
            kept = folder / ASIDE / finding.path.relative_to(folder)
            kept.parent.mkdir(parents=True, exist_ok=True)
            shutil.rmtree(kept, ignore_errors=True) if kept.is_dir() else kept.unlink(missing_ok=True)
            finding.path.rename(kept)
        elif finding.remedy == "remove":
            shutil.rmtree(finding.path) if finding.path.is_dir() else finding.path.unlink(missing_ok=True)
        elif finding.remedy == "plan":
            adopted += [record.job] if (record := store.record(finding.path.stem)) else []
    if adopted:
        store.add_plan(Plan("recovered", tuple(adopted), command=f"{program()} doctor --repair"))


def _unreadable(paths: Iterable[Path], read: Callable[[Path], object]) -> Iterator[Finding]:
    for path in sorted(paths):
        try:
            read(path)
        except InputError as error:
            yield Finding(path, _reason(error), "aside")


def _records(store: Store) -> Iterator[Finding]:
    planned = set()
    for path in sorted(store.folder.glob("plans/*.json")):
        try:
            planned |= {job.id for job in store.plan(path).jobs}
        except InputError:
            continue
    recorded = set()
    for path in sorted(store.folder.glob("records/*/*.json")):
        recorded.add(path.stem)
        try:
            record = store.record(path.stem)
            if record is None:
                yield Finding(path, "the record lies in the wrong folder", "aside")
                continue
        except InputError as error:
            yield Finding(path, _reason(error), "aside")
            continue
        if record.outcome.ok:
            try:
                store.estimate(path.stem, record)
            except InputError as error:
                yield Finding(path, f"its estimate is not there or damaged: {_reason(error)}", "aside")
                continue
        if path.stem not in planned:
            yield Finding(path, "no plan names this record, so no table shows it", "plan")
    for path in sorted(store.folder.glob("estimates/*/*.npz")):
        if path.stem not in recorded:
            yield Finding(path, "an estimate without a record, left by a run that was killed", "remove")


def _leftovers(store: Store) -> Iterator[Finding]:
    for path in sorted(store.abandoned()):
        yield Finding(path, "left by a process that is gone", "remove")
    for path in sorted(store.folder.rglob("*.part")):
        if not path.is_relative_to(store.folder / "work"):
            yield Finding(path, "half of a file, left by a process that was killed", "remove")


def _reason(error: InputError) -> str:
    return str(error).split("; ")[0]
