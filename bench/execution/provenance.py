"""Where a record comes from: versions, machine, git state and command."""

import platform
import shlex
import subprocess
import sys
from functools import cache
from importlib import metadata
from pathlib import Path

from bench import __version__


@cache
def of_this_run() -> dict[str, str]:
    """Facts that every record of one run shares."""
    return {
        "bench": __version__,
        "git": _git_state(),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "host": platform.node(),
        "cpu": _cpu_model(),
        "command": shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]]),
    }


@cache
def versions(packages: tuple[str, ...]) -> dict[str, str]:
    """Installed versions of the packages, and of numpy and scipy."""
    found = {}
    for name in ("numpy", "scipy", *packages):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "unknown"
    return found


def _git_state() -> str:
    """Commit of the checkout this runs from, with ``+dirty`` where files differ; empty outside a checkout."""
    here = Path(__file__).parent
    try:
        commit, changes = (
            subprocess.run(
                ["git", "-C", str(here), *command], capture_output=True, text=True, check=True
            ).stdout.strip()
            for command in (["rev-parse", "HEAD"], ["status", "--porcelain", "--untracked-files=no"])
        )
    except (OSError, subprocess.CalledProcessError):
        return ""
    return commit + ("+dirty" if changes else "")


def _cpu_model() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor()
