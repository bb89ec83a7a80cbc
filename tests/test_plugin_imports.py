"""Methods and datasets know the door of `bench`, the formats, and their own folders downward; nothing else."""

import ast
from collections.abc import Iterator
from importlib.util import resolve_name
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOORS = {"methods": {"bench"}, "datasets": {"bench", "bench.core.errors", "bench.formats"}}
FILES = [path.relative_to(ROOT) for top in DOORS for path in sorted((ROOT / top).rglob("*.py"))]


def imported(path: Path) -> Iterator[str]:
    """Every module that a file names, those of its own tree as ``methods.…``; ``from x import y`` gives ``x.y``."""
    package = ".".join(path.parent.parts)
    for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = resolve_name("." * node.level + (node.module or ""), package)
            yield from (f"{base}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("path", FILES, ids=str)
def test_plug_ins_come_through_the_door(path: Path) -> None:
    for name in imported(path):
        if name.split(".")[0] == "bench":
            module = name.rsplit(".", 1)[0]
            assert {module, ".".join(module.split(".")[:2])} & DOORS[path.parts[0]], name


@pytest.mark.parametrize("path", FILES, ids=str)
def test_what_is_shared_knows_no_plug_in(path: Path) -> None:
    """Nor does one plug-in know another: whatever two use lives in a folder with an underscore."""
    for name in imported(path):
        parts = name.split(".")
        if parts[0] in DOORS:
            assert parts[0] == path.parts[0], name
            assert parts[1].startswith("_"), name
