"""Where the numbers come from: commands, code, versions, machines, limits and dates, gathered from the records."""

from collections.abc import Iterable

from bench.storage.record import Record
from bench.storage.store import Store

Facts = list[tuple[str, tuple[str, ...]]]


def origin(store: Store, job_ids: Iterable[str]) -> Facts:
    """Name and values of each fact, every value once, in the order in which they are met."""
    records = [record for job in job_ids if (record := store.record(job)) is not None]
    plans = store.plans()
    finished = sorted(record.finished for record in records)
    facts: Facts = [
        ("Command", _distinct(plan.command for plan in plans)),
        ("Suite", _distinct(plan.suite for plan in plans)),
        ("Finished", (f"{finished[0]} to {finished[-1]}",) if finished else ()),
        ("Machine", _distinct(map(_machine, records))),
        ("Benchmark", _distinct(map(_code, records))),
        ("Python", _distinct(record.provenance.get("python", "") for record in records)),
        ("Packages", _packages(records)),
        ("Limits of a job", _distinct(map(_limits, records))),
        ("Threads of a job", _distinct(str(record.limits.threads) for record in records)),
    ]
    return [(name, values) for name, values in facts if values]


def _distinct(values: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(filter(None, values)))


def _machine(record: Record) -> str:
    return ", ".join(filter(None, (record.provenance.get(name, "") for name in ("cpu", "platform", "host"))))


def _code(record: Record) -> str:
    git = record.provenance.get("git", "")
    return f"{record.provenance.get('bench', '')}{f', git {git}' if git else ''}"


def _limits(record: Record) -> str:
    return f"{record.limits.seconds:g} s, {record.limits.memory_gib:g} GiB"


def _packages(records: Iterable[Record]) -> tuple[str, ...]:
    return _distinct(f"{name} {version}" for record in records for name, version in sorted(record.versions.items()))
