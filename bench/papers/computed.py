"""What has been computed for an item of a paper."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bench.core.errors import InputError
from bench.core.problem import Instance
from bench.plugins import selection
from bench.plugins.catalog import catalog
from bench.scoring.results import Results
from bench.suite.plan import Job


@dataclass(frozen=True)
class Computed:
    """Jobs with their scores.

    Parameters
    ----------
    jobs
        Those of the item, and no others of the run's folder.
    results
        Their scores; None where there was nothing to run.
    notes
        For each instance, what a reader must know of it.
    missing
        A sentence for what is not on disk.
    instance
        Reads the instance of a job.
    """

    jobs: Sequence[Job] = ()
    results: Results | None = None
    notes: Mapping[str, tuple[str, ...]] | None = None
    missing: tuple[str, ...] = ()
    instance: Callable[[Job], Instance] | None = None


def one(kind: str, text: str) -> tuple[str, dict[str, Any]]:
    """Name and given parameters of a selection that stands for one configuration.

    Raises
    ------
    InputError
        Where it stands for several, or for something unknown.
    """
    chosen = catalog(kind).select([text])
    if len(chosen) != 1:
        raise InputError(f"a layout names one {kind} at a time, and '{text}' stands for {len(chosen)}")
    info, parameters = chosen[0]
    return info.name, parameters


def label(kind: str, text: str) -> str:
    """The selection as a run spells it."""
    return selection.format_selection(*one(kind, text))


def spelled(job: Job) -> str:
    """The method of a job, as `label` spells it."""
    return selection.format_selection(job.method, dict(job.parameters))


def extended(text: str, parameters: Mapping[str, Any]) -> str:
    """A selection with further parameters."""
    parsed = selection.parse(text)
    combinations = parsed.combinations()
    if len(combinations) != 1:
        raise InputError(f"a layout names one dataset at a time, and '{text}' stands for {len(combinations)}")
    return selection.format_selection(parsed.name, {**combinations[0], **parameters})
