"""Everything that is kept of a job besides its arrays."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from bench.core import typed
from bench.core.errors import InputError
from bench.core.limits import Limits
from bench.core.outcome import Outcome
from bench.suite.plan import Job

SCHEMA = 3  # of a record and of the folder that it is in; raised when their form changes


@dataclass(frozen=True)
class Moment:
    """A checkpoint without its rotations; see `bench.core.problem.Checkpoint`."""

    iteration: int
    seconds: float
    diagnostics: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Report:
    """What the child of a job tells of its solution; as far as it came.

    Parameters
    ----------
    used
        What it used of what came with the measurements, such as weights.
    threads, core
        How many threads the numerical libraries had, and the one core that the child was pinned to, if any.
    solve_s, conversion_s
        Seconds that `solve` took, without those that it spent on converting for a library, and these.
    peak_mib
        Resident memory that was added while it ran.
    iterations, stop_reason, cost, certificate, notes
        As in `bench.core.problem.Estimate`.
    checkpoints
        When they were taken; their rotations are with the estimate.
    warnings
        Some of the different ones.
    solves_s, waited
        Of a round of a timing run: the seconds of its solutions, and the share of their time in which another process
        had the core.
    """

    used: tuple[str, ...] = ()
    threads: int | None = None
    core: int | None = None
    solve_s: float | None = None
    conversion_s: float | None = None
    peak_mib: float | None = None
    iterations: int | None = None
    stop_reason: str = ""
    cost: float | None = None
    certificate: float | None = None
    notes: tuple[str, ...] = ()
    checkpoints: tuple[Moment, ...] = ()
    warnings: tuple[str, ...] = ()
    solves_s: tuple[float, ...] = ()
    waited: float | None = None


@dataclass(frozen=True)
class Record:
    """What is known of a job that has ended.

    Parameters
    ----------
    job, outcome, limits
        What was run, how it ended, and what it was allowed to use.
    finished
        When, in ISO 8601.
    versions, provenance
        Of the packages it needed; of the benchmark, the machine and the command.
    report
        What its child told.
    wall_s
        Seconds from the start of its child to its end.
    log
        The end of what it printed.
    round_s
        Of a timing run: the solve seconds of its rounds; `Report.solve_s` is their median then.
    """

    job: Job
    outcome: Outcome
    limits: Limits
    finished: str
    versions: Mapping[str, str] = field(default_factory=dict)
    provenance: Mapping[str, str] = field(default_factory=dict)
    report: Report = field(default_factory=Report)
    wall_s: float | None = None
    log: str = ""
    round_s: tuple[float, ...] = ()

    @classmethod
    def from_json(cls, content: Mapping[str, Any], where: str) -> "Record":
        """Read what `to_json` wrote.

        Parameters
        ----------
        where
            What it is the content of, for messages.

        Raises
        ------
        InputError
            Where it is something else, or of another version.
        """
        if content.get("schema") != SCHEMA:
            raise InputError(f"{where}: it is no record of version {SCHEMA}, which is what this bench reads")
        return typed.read(cls, {key: value for key, value in content.items() if key != "schema"}, where)

    def to_json(self) -> dict[str, Any]:
        """As a file keeps it."""
        return asdict(self) | {"schema": SCHEMA}
