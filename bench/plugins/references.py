"""Where the references of methods and datasets are, in BibTeX."""

import re
import sys
from collections.abc import Iterable
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

import bench
from bench.core.errors import InputError, suggestion
from bench.plugins.declare import Info

FILE = "references.bib"
SUITE = "rotsync-bench"
BENCHMARK = "tejus2023"  # the paper that this benchmark starts from
_START = re.compile(r"^@(\w+)\s*\{\s*([^\s,{}]+)\s*,", re.MULTILINE)


def read_entries(path: Traversable) -> dict[str, str]:
    """Entries of a BibTeX file by key, each as it is written there.

    Raises
    ------
    InputError
        Where an entry does not end before the next begins, or a key occurs twice.
    """
    text = path.read_text(encoding="utf-8")
    starts = list(_START.finditer(text))
    ends = [start.start() for start in starts[1:]] + [len(text)]
    found: dict[str, str] = {}
    for start, end in zip(starts, ends, strict=True):
        key, entry = start[2], _balanced(text[start.start() : end])
        where = f"{path}:{text.count(chr(10), 0, start.start()) + 1}"
        if not entry:
            raise InputError(f"{where}: the entry '{key}' has no closing brace")
        if key in found:
            raise InputError(f"{where}: there are two entries '{key}'")
        found[key] = entry
    return found


def cite_keys(info: Info) -> list[str]:
    """Keys that a plug-in declares, one or several with commas."""
    return [key.strip() for key in info.cite.split(",") if key.strip()]


def references(info: Info) -> dict[str, str]:
    """Entries that a plug-in cites, from ``references.bib`` beside its file or else from the project's.

    Raises
    ------
    InputError
        Where a key is in neither file.
    """
    known = {SUITE: suite_entry()} | _shipped()
    beside = Path(str(sys.modules[info.cls.__module__].__file__)).with_name(FILE)
    if beside.is_file():
        known |= read_entries(beside)
    for key in cite_keys(info):
        if key not in known:
            raise InputError(
                f"{info.kind} '{info.name}' cites '{key}', which is neither in {beside} nor in the project's "
                f"{FILE}{suggestion(key, known)}"
            )
    return {key: known[key] for key in cite_keys(info)}


def bibliography(infos: Iterable[Info]) -> dict[str, str]:
    """The benchmark and what it is built on, then what the plug-ins cite, each once; raises as `references`."""
    found = {SUITE: suite_entry(), BENCHMARK: _shipped()[BENCHMARK]}
    for info in infos:
        found |= references(info)
    return found


def suite_entry() -> str:
    """The entry of this benchmark, in the version that runs; ``CITATION.cff`` says the same."""
    return (
        f"@misc{{{SUITE},\n"
        "  author = {{The rotsync-bench contributors}},\n"
        "  title  = {rotsync-bench: a Benchmark of Rotation Synchronization Methods},\n"
        "  year   = {2026},\n"
        f"  note   = {{Software, version {bench.__version__}}},\n"
        "}"
    )


def _shipped() -> dict[str, str]:
    return read_entries(resources.files("bench.methods") / FILE)


def _balanced(text: str) -> str:
    """The text up to the brace that closes its first one; empty where there is none."""
    depth = 0
    for brace in re.finditer(r"(?<!\\)[{}]", text):
        depth += 1 if brace[0] == "{" else -1
        if depth == 0:
            return text[: brace.end()]
    return ""
