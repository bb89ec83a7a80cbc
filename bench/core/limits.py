"""What a job may use."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Of one job; in a timing run, of one round of it.

    Parameters
    ----------
    seconds
        Wall clock, from when the method is compiled and loaded.
    memory_gib
        Resident memory of the child and its descendants.
    threads
        How many threads the numerical libraries may use.
    """

    seconds: float
    memory_gib: float
    threads: int = 1
