"""An appearance for a while."""

from collections.abc import Iterator
from contextlib import contextmanager

from bench.reporting.appearance import Appearance, put_in_force


@contextmanager
def using(appearance: Appearance) -> Iterator[None]:
    """Put it in force, and the default again."""
    put_in_force(appearance)
    try:
        yield
    finally:
        put_in_force(Appearance())
