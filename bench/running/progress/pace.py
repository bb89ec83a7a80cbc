"""How long jobs take and when a run will end, from the times of jobs that have ended. Pure: no clock, no disk."""

import bisect
import heapq
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from bench.storage.record import Record

BIN = 0.05  # of the logarithm of a size; sizes closer than that are one
PRIOR_EXPONENT = 1.0  # time grows with size like this until the times say otherwise
PRIOR_WEIGHT = 1.0  # of the prior, in squared logarithms of size
EXPONENTS = (0.0, 4.0)
OVERDUE = 1.25  # a job that runs longer than expected is expected to take that many times what it has taken
SHORTEST_S = 1e-4
FEW = 4  # jobs whose median tells what a start costs


@dataclass(frozen=True)
class Task:
    """A job as far as its time is concerned.

    Parameters
    ----------
    method
        The method, without its parameters.
    configured
        With them: what is timed together.
    size
        Of the instance, in any unit that time grows with; NaN where unknown.
    """

    method: str
    configured: str
    size: float = math.nan


@dataclass
class _Times:
    """Times of one configured method by the bin of its sizes: count and sum of seconds, and of their logarithms."""

    bins: dict[int, tuple[int, float, float]] = field(default_factory=dict)
    unsized: list[float] = field(default_factory=list)

    def add(self, size: float, seconds: float) -> None:
        if math.isnan(size):
            self.unsized.append(seconds)
            return
        count, total, logs = self.bins.get(key := _bin(size), (0, 0.0, 0.0))
        self.bins[key] = (count + 1, total + seconds, logs + math.log(max(seconds, SHORTEST_S)))

    def mean(self) -> float:
        """Mean seconds, whatever the size."""
        count = len(self.unsized) + sum(entry[0] for entry in self.bins.values())
        return (sum(self.unsized) + sum(entry[1] for entry in self.bins.values())) / count

    def at(self, size: float) -> float:
        """Expected seconds: a power of the size, its exponent drawn towards `PRIOR_EXPONENT`, its sum what was seen."""
        if math.isnan(size) or not self.bins:
            return self.mean()
        count = sum(entry[0] for entry in self.bins.values())
        middle = sum(BIN * key * entry[0] for key, entry in self.bins.items()) / count
        height = sum(entry[2] for entry in self.bins.values()) / count
        spread = sum(entry[0] * (BIN * key - middle) ** 2 for key, entry in self.bins.items())
        slope = sum((BIN * key - middle) * (entry[2] - entry[0] * height) for key, entry in self.bins.items())
        exponent = (slope + PRIOR_WEIGHT * PRIOR_EXPONENT) / (spread + PRIOR_WEIGHT)
        exponent = min(max(exponent, EXPONENTS[0]), EXPONENTS[1])
        fitted = sum(entry[0] * math.exp(exponent * (BIN * key - middle)) for key, entry in self.bins.items())
        seen = sum(entry[1] for entry in self.bins.values())
        return float(seen / fitted * math.exp(exponent * (BIN * _bin(size) - middle)))


class Pace:
    """What is known of how long jobs take.

    A job takes the seconds of solving, which grow with its instance, and others that do not: starting a child,
    imports, compilation. A configured method is expected by its own times; where it has none, by the median of what the
    method's other configurations would take, and else of what all methods would take.
    """

    def __init__(self) -> None:
        self.seen = 0
        self._around: dict[str, list[float]] = {}  # seconds besides solving, sorted
        self._around_any: list[float] = []
        self._times: dict[str, dict[str, _Times]] = {}
        self._expected: dict[tuple[str, str, int | None], float | None] = {}

    def see(self, task: Task, record: Record) -> None:
        """Learn from the record of a job; one that took no time, because its package is missing, teaches nothing."""
        if not record.wall_s:
            return
        rounds = record.job.rounds
        seconds = record.wall_s * max(rounds, 1)
        solving = record.report.solve_s if not rounds else None
        solving = seconds if solving is None else min(solving, seconds)
        self._times.setdefault(task.method, {}).setdefault(task.configured, _Times()).add(task.size, solving)
        for around in (self._around.setdefault(task.configured, []), self._around_any):
            bisect.insort(around, seconds - solving)
        self.seen += 1
        self._expected.clear()

    def knows(self, task: Task) -> bool:
        """Whether the task's method has been timed, under any parameters."""
        return task.method in self._times

    def expect(self, task: Task) -> float | None:
        """Expected seconds of a job; None as long as nothing has been seen."""
        key = task.method, task.configured, None if math.isnan(task.size) else _bin(task.size)
        if key not in self._expected:
            solving = self._solving(task)
            self._expected[key] = None if solving is None else solving + self._besides(task)
        return self._expected[key]

    def _solving(self, task: Task) -> float | None:
        siblings = self._times.get(task.method, {})
        if task.configured in siblings:
            return siblings[task.configured].at(task.size)
        others = siblings or {c: times for by_name in self._times.values() for c, times in by_name.items()}
        values = sorted(times.at(task.size) for times in others.values())
        return values[len(values) // 2] if values else None

    def _besides(self, task: Task) -> float:
        """Median over the method's jobs, or over all; the first jobs of a run wait for what later ones find started."""
        own = self._around.get(task.configured, [])
        for around in (own, self._around_any):
            if len(around) >= FEW:
                return around[len(around) // 2]
        return self._around_any[0] if self._around_any else 0.0


def remaining_s(
    pace: Pace, waiting: Iterable[Task], running: Sequence[tuple[Task, float]] = (), workers: int = 1
) -> float | None:
    """Seconds until the last job ends, when each worker takes the next job in order as soon as it is free.

    Parameters
    ----------
    pace
        What is known.
    waiting
        Jobs that have not started, in their order.
    running
        Jobs in progress, with the seconds they have taken.
    workers
        Jobs at a time.

    Returns
    -------
    None as long as nothing has been seen.
    """
    free = []
    for task, elapsed in running:
        expected = pace.expect(task)
        if expected is None:
            return None
        free.append(expected - elapsed if expected > elapsed else (OVERDUE - 1) * elapsed)
    free += [0.0] * (workers - len(free))
    heapq.heapify(free)
    end = max(free)
    for task in waiting:
        expected = pace.expect(task)
        if expected is None:
            return None
        done = heapq.heappop(free) + expected
        heapq.heappush(free, done)
        end = max(end, done)
    return end


def span(seconds: float) -> str:
    """A duration in words: ``8 s``, ``2 min 05 s``, ``3 h 20 min``, ``4 d 2 h``."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    minutes = round(seconds / 60)
    if minutes < 24 * 60:
        return f"{minutes // 60} h {minutes % 60:02d} min"
    hours = round(seconds / 3600)
    return f"{hours // 24} d {hours % 24} h"


def _bin(size: float) -> int:
    return round(math.log(max(size, 1.0)) / BIN)
