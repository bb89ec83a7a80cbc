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
        ("Python", _distinct(r.provenance.get("python", "") for r in records)),
        ("Packages", _distinct(f"{name} {version}" for r in records for name, version in sorted(r.versions.items()))),
        ("Limits of a job", _distinct(f"{r.limits.seconds:g} s, {r.limits.memory_gib:g} GiB" for r in records)),
        ("Threads of a job", _distinct(str(r.limits.threads) for r in records)),
    ]
    return [(name, values) for name, values in facts if values]


def _distinct(values: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(filter(None, values)))


def _machine(record: Record) -> str:
    return ", ".join(filter(None, (record.provenance.get(name, "") for name in ("cpu", "platform", "host"))))


def _code(record: Record) -> str:
    git = record.provenance.get("git", "")
    return f"{record.provenance.get('bench', '')}{f', git {git}' if git else ''}"
