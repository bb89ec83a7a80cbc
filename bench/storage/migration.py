"""Versions of the layout of a run's folder, and the way from each to the next.

Every step can be interrupted and done again. Version 1 kept records and estimates in one flat folder each, and
plans with every fact of every job spelled out.
"""

import json
from pathlib import Path
from typing import Any

from bench.core.errors import InputError
from bench.suite.plan import Job, Plan, encode

FILE = "schema.json"
SCHEMA = 2


def migrate(folder: Path) -> None:
    """Bring the folder of a run to today's layout.

    Raises
    ------
    InputError
        Where a newer version wrote it, or where it cannot be changed.
    """
    found = _version(folder)
    if found > SCHEMA:
        raise InputError(f"{folder} has layout {found}, and this version knows up to {SCHEMA}; upgrade rotsync-bench")
    if found == SCHEMA:
        return
    try:
        for version in range(found, SCHEMA):
            _STEPS[version](folder)
        (folder / FILE).write_text(json.dumps({"schema": SCHEMA}), encoding="utf-8")
    except OSError as error:
        raise InputError(f"{folder} has the layout of an older version and cannot be changed: {error}") from error


def _version(folder: Path) -> int:
    try:
        return int(json.loads((folder / FILE).read_text(encoding="utf-8"))["schema"])
    except FileNotFoundError:
        return 1
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{folder / FILE} cannot be read; delete it to have the layout found out again") from error


def _from_1(folder: Path) -> None:
    for kind, ending in (("records", ".json"), ("estimates", ".npz")):
        for path in (folder / kind).glob(f"*{ending}"):
            shard = path.parent / path.name[:2]
            shard.mkdir(exist_ok=True)
            path.replace(shard / path.name)
    for path in (folder / "plans").glob("*.json"):
        content = _read(path)
        if isinstance(content.get("jobs"), list):
            jobs = tuple(Job(**job) for job in content["jobs"])
            missing = tuple(content["missing"])
            plan = Plan(content["suite"], jobs, missing, content["command"], content.get("baseline", ""))
            temporary = path.with_suffix(".part")
            temporary.write_text(json.dumps(encode(plan) | {"schema": 2}), encoding="utf-8")
            temporary.replace(path)


def _read(path: Path) -> dict[str, Any]:
    """Content of a plan; nothing where it cannot be read, which is told when it is used."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}


_STEPS = {1: _from_1}
