"""Named budgets: ``1c-60s-4g`` is one core, sixty seconds and four GiB of memory, for each job."""

import re
from dataclasses import dataclass

from bench.core.errors import InputError

SECONDS = {"s": 1, "m": 60, "h": 3600}
_NUMBER = r"\d{1,9}(?:\.\d{1,9})?"
_FORM = re.compile(rf"(?P<cores>\d{{1,9}})c-(?P<time>{_NUMBER})(?P<unit>[smh])-(?P<memory>{_NUMBER})g", re.ASCII)


@dataclass(frozen=True)
class Budget:
    """What each job may use.

    Parameters
    ----------
    name
        As it was given, such as ``1c-60s-4g``.
    threads
        Cores: how many threads the numerical libraries may use.
    seconds
        Wall clock.
    memory_gib
        Resident memory.
    """

    name: str
    threads: int
    seconds: float
    memory_gib: float


def parse(name: str) -> Budget:
    """Read a budget: cores, time in seconds (s), minutes (m) or hours (h), and GiB of memory.

    Raises
    ------
    InputError
        Where the name has another form, or a part of it is zero.
    """
    match = _FORM.fullmatch(name)
    if match is None:
        raise InputError(f"budget '{name}': write cores, time and GiB, such as 1c-60s-4g, 4c-10m-16g or 1c-0.5h-2g")
    budget = Budget(name, int(match["cores"]), float(match["time"]) * SECONDS[match["unit"]], float(match["memory"]))
    for what in ("threads", "seconds", "memory_gib"):
        if getattr(budget, what) == 0:
            raise InputError(f"budget '{name}': a job needs some of everything, and {what} is 0")
    return budget
