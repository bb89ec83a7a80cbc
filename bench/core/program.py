"""How the user started the program, for the commands that help and messages spell out."""

import sys
from pathlib import Path

SCRIPT = "rotsync-bench"


def program() -> str:
    """``rotsync-bench`` where it was started so, else ``python -m bench``."""
    return SCRIPT if Path(sys.argv[0]).stem == SCRIPT else "python -m bench"
