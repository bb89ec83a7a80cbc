"""The live table of a run: methods by what is done, failed, running and left."""

import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from bench.running.progress.pace import Pace, Task, remaining_s, span
from bench.storage.record import Record
from bench.suite.plan import Job

BUSY = 50  # the ETA is computed anew when that many times what it took has gone by
OTHER_LINES = 4  # head of the table, its rule, the line below and one to spare
FEWEST_ROWS = 3
RUNNING = "running now"
WIDE = 70  # columns that it takes to say what is running


@dataclass
class _Row:
    """What is known of one configured method."""

    total: int = 0
    done: int = 0
    failed: int = 0
    solve_s: list[float] = field(default_factory=lambda: [0.0, 0.0])  # how many, their sum


class Board:
    """State of a run, drawn whenever rich asks; safe to draw from another thread.

    Parameters
    ----------
    jobs
        What is to run, in its order.
    task
        What a job is as far as its time is concerned.
    pace
        What is known of times; every job that ends adds to it.
    workers
        Jobs at a time.
    in_order
        Whether jobs start in their order, so that what is running is known: the first that have not ended.
    clock
        Seconds.
    """

    def __init__(
        self,
        jobs: Sequence[Job],
        task: Callable[[Job], Task],
        pace: Pace,
        workers: int,
        *,
        in_order: bool = True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.pace = pace
        self.workers = workers
        self._in_order = in_order
        self._clock = clock
        self._lock = threading.RLock()
        self._start = clock()
        self._jobs = {job.id: job for job in jobs}
        self._tasks = {job.id: task(job) for job in jobs}
        self._order = deque(self._jobs)
        self._waiting = dict.fromkeys(self._jobs)
        self._counts = Counter(self._tasks.values())  # of those waiting
        self._running: dict[str, float] = {}
        self._rows: dict[str, _Row] = {}
        for known in self._tasks.values():
            self._rows.setdefault(known.configured, _Row()).total += 1
        self._again = -math.inf  # when to compute the next two anew
        self._end: float | None = None
        self._left: dict[str, float] = {}
        self._start_next()

    @property
    def elapsed_s(self) -> float:
        """Seconds since the start."""
        return self._clock() - self._start

    def end(self, job: Job, record: Record) -> None:
        """Count a job that has ended."""
        with self._lock:
            known = self._tasks[job.id]
            self.pace.see(known, record)
            self._running.pop(job.id, None)
            self._leave(job.id)
            row = self._rows[known.configured]
            row.done += 1
            row.failed += not record.outcome.ok
            if record.outcome.ok and record.report.solve_s is not None:
                row.solve_s[0] += 1
                row.solve_s[1] += record.report.solve_s
            self._start_next()

    def eta_s(self) -> float | None:
        """Seconds until the run ends; None as long as nothing is known of times."""
        with self._lock:
            self._foresee()
            return None if self._end is None else max(self._end - self._clock(), 0.0)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Draw the table, no higher than the terminal, and the line below it."""
        height = options.height or console.size.height
        with self._lock:
            yield Group(self._table(max(height - OTHER_LINES, FEWEST_ROWS), options.max_width), self._footer())

    def _leave(self, job: str) -> None:
        """A job waits no longer."""
        if job in self._waiting:
            del self._waiting[job]
            self._counts[self._tasks[job]] -= 1

    def _start_next(self) -> None:
        while self._in_order and self._waiting and len(self._running) < self.workers:
            job = self._order.popleft()
            if job in self._waiting:
                self._leave(job)
                self._running[job] = self._clock()

    def _foresee(self) -> None:
        """When the run ends, and the seconds left of each configured method, spread over the workers."""
        now = self._clock()
        if now < self._again:
            return
        running = [(self._tasks[job], now - since) for job, since in self._running.items()]
        end = remaining_s(self.pace, (self._tasks[job] for job in self._waiting), running, self.workers)
        self._end = None if end is None else now + end
        self._left = {}
        for known, work in self._work(running):
            self._left[known.configured] = self._left.get(known.configured, 0.0) + work / self.workers
        self._again = now + BUSY * (self._clock() - now)

    def _work(self, running: Sequence[tuple[Task, float]]) -> Iterator[tuple[Task, float]]:
        for known, count in self._counts.items():
            if count and (expected := self.pace.expect(known)) is not None:
                yield known, count * expected
        for known, elapsed in running:
            if (expected := self.pace.expect(known)) is not None:
                yield known, max(expected - elapsed, 0.0)

    def _table(self, rows: int, width: int) -> Table:
        with_running = self._in_order and width >= WIDE
        table = Table(box=None, padding=(0, 1, 0, 0), expand=True, header_style="bold")
        table.add_column("method", ratio=3, no_wrap=True, overflow="ellipsis")
        for head in ("done", "failed", "mean s", "left"):
            table.add_column(head, justify="right", no_wrap=True)
        if with_running:
            table.add_column(RUNNING, ratio=3, no_wrap=True, overflow="ellipsis")
        running = self._running_of()
        self._foresee()
        left = self._left
        shown, folded = self._chosen(rows, running)
        for name in shown:
            extra = (Text(running.get(name, "")),) if with_running else ()
            table.add_row(*self._cells(name, [self._rows[name]], left.get(name)), *extra)
        if folded:
            known = [left[name] for name in folded if name in left]
            together = sum(known) if known else None
            table.add_row(*self._cells(f"… {len(folded)} more", [self._rows[name] for name in folded], together))
        return table

    def _chosen(self, rows: int, running: Mapping[str, str]) -> tuple[list[str], list[str]]:
        """Methods that are shown and folded: what runs goes first, then what is unfinished; all keep their order."""
        names = list(self._rows)
        if len(names) <= rows:
            return names, []

        def rank(name: str) -> int:
            row = self._rows[name]
            return 0 if name in running else 1 if row.done < row.total else 2

        kept = set(sorted(names, key=rank)[: rows - 1])
        return [name for name in names if name in kept], [name for name in names if name not in kept]

    def _cells(self, name: str, rows: Sequence[_Row], left: float | None) -> list[str | Text]:
        done, total, failed = (sum(getattr(row, key) for row in rows) for key in ("done", "total", "failed"))
        solved, seconds = (sum(row.solve_s[k] for row in rows) for k in (0, 1))
        return [
            Text(name, style="dim" if done == total else ""),
            f"{done}/{total}",
            Text(str(failed) if failed else "", style="red"),
            f"{seconds / solved:.3g}" if solved else "",
            span(left) if left is not None and done < total else "",
        ]

    def _running_of(self) -> dict[str, str]:
        """What runs of each configured method: the instance and for how long, the longest first."""
        now = self._clock()
        found: dict[str, list[str]] = {}
        for job, since in self._running.items():
            text = f"{span(now - since)} {self._jobs[job].instance}"
            found.setdefault(self._tasks[job].configured, []).append(text)
        return {name: texts[0] + (f" +{len(texts) - 1}" if len(texts) > 1 else "") for name, texts in found.items()}

    def _footer(self) -> Table:
        done = sum(row.done for row in self._rows.values())
        left = self.eta_s()
        ends = f"ETA {span(left)}" if left is not None else "ETA unknown"
        line = Table.grid(padding=(0, 1), expand=True)
        line.add_column(ratio=1)
        line.add_column(no_wrap=True)
        text = f"{done}/{len(self._jobs)} jobs · {span(self.elapsed_s)} · {ends} · {self.workers} at a time"
        line.add_row(ProgressBar(total=max(len(self._jobs), 1), completed=done), text)
        return line
