"""The leaderboard of the committed results, as a folder of the site."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path

from bench.site.committed import Committed, read_all
from bench.site.pages import rendered

REFERENCE = Path(__file__).parent.parent.parent / "results" / "reference"
FOLDER = "leaderboard"


@cache
def committed() -> list[Committed]:
    """The committed results."""
    return read_all([REFERENCE])


def files() -> Iterator[tuple[str, str]]:
    """Path and content of each page."""
    for name, text in rendered(committed(), "Rotation synchronization: leaderboard").items():
        if not name.startswith("."):
            yield f"{FOLDER}/{name}", text
