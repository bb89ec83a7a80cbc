"""Bring what several folders hold of a run together in one."""

import contextlib
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from bench.core.digest import digest
from bench.core.errors import InputError
from bench.storage.record import Record
from bench.storage.store import Store


@dataclass
class Merged:
    """What a merge did.

    Parameters
    ----------
    added, replaced, kept
        Records that were new; that took the place of one that had ended worse or earlier; that were there already.
    told
        A sentence for everything that could not be read, which was left where it is, and for every job whose two
        estimates differ, of which the one that was there first is kept.
    """

    added: int = 0
    replaced: int = 0
    kept: int = 0
    told: list[str] = field(default_factory=list)


def merge(sources: Sequence[Path], into: Path) -> Merged:
    """Add plans, instances, records and estimates of the sources to a folder, which may be new; sources stay.

    A merge that was interrupted can be done again. Where both folders have a record of the same job, one that ended
    well goes before one that did not, then the one that was there goes before a later one that ended well too, and a
    later failure before an earlier one. Two versions of one method stay two; see `bench.suite.plan.newest`.

    Raises
    ------
    InputError
        Where a source is no run, or ordinary and timing runs would be mixed.
    """
    stores = [Store.open(source) for source in sources]
    target = Store.open(into) if (into / "plans").is_dir() else Store(into)
    held = [store for store in (*stores, target) if (store.folder / "plans").is_dir()]
    if len({plan.timing for store in held for plan in store.plans()}) > 1:
        raise InputError("an ordinary run and a timing run cannot be merged; their times mean different things")
    merged = Merged()
    target.mark()
    for store in stores:
        for path in sorted(store.folder.glob("records/*/*.json")):
            _merge_record(store, target, path.stem, merged)
        for path in sorted(store.folder.glob("instances/*")):
            _merge_instance(store, target, path.name, merged)
        paths = sorted(store.folder.glob("plans/*.json"))
        run = digest([str(store.folder.resolve()), paths[0].name])[:8] if paths else ""
        for path in paths:
            plan = store.plan(path)
            target.add_plan(replace(plan, source=plan.source or run), path.name)
    return merged


def _merge_record(source: Store, target: Store, job_id: str, merged: Merged) -> None:
    try:
        theirs = _whole(source, job_id)
    except InputError as error:
        merged.told.append(str(error))
        return
    if theirs is None:
        return
    ours = None
    with contextlib.suppress(InputError):
        ours = _whole(target, job_id)
    if ours is not None and not _better(theirs, ours):
        merged.kept += 1
        if theirs.outcome.ok and ours.outcome.ok and _differ(source, target, job_id):
            merged.told.append(
                f"the estimates of job {job_id} differ between {target.folder}, which is kept, and {source.folder}"
            )
        return
    if theirs.outcome.ok:
        target.copy_in(source.estimate_path(job_id), target.estimate_path(job_id))
    target.copy_in(source.record_path(job_id), target.record_path(job_id))
    if ours is None:
        merged.added += 1
    else:
        merged.replaced += 1


def _whole(store: Store, job_id: str) -> Record | None:
    record = store.record(job_id)
    if record is not None and record.outcome.ok:
        store.estimate(job_id, record)
    return record


def _better(theirs: Record, ours: Record) -> bool:
    if theirs.outcome.ok or ours.outcome.ok:
        return not ours.outcome.ok
    return theirs.finished > ours.finished


def _differ(source: Store, target: Store, job_id: str) -> bool:
    ours, theirs = (store.estimate(job_id).rotations for store in (target, source))
    return ours.shape != theirs.shape or ours.tobytes() != theirs.tobytes()


def _merge_instance(source: Store, target: Store, key: str, merged: Merged) -> None:
    final = target.folder / "instances" / key
    if final.exists():
        return
    try:
        source.instance(key)
    except InputError as error:
        merged.told.append(str(error))
        return
    with target.work_folder() as work:
        shutil.copytree(source.folder / "instances" / key, work, dirs_exist_ok=True)
        final.parent.mkdir(parents=True, exist_ok=True)
        work.rename(final)
