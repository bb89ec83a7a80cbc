"""One page a method and a dataset, from its declaration, its docstring and the committed results."""

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Any

import board
from bench.plugins import selection
from bench.plugins.catalog import catalog
from bench.plugins.declare import DatasetInfo, Info, MethodInfo
from bench.plugins.references import references
from bench.reporting.html.words import spoken
from bench.reporting.tables.printed import degrees, seconds
from bench.reporting.tables.rows import Entry, Scene
from bench.site.board import run_link
from bench.site.committed import Committed

FOLDERS = {"methods/": "method", "datasets/": "dataset"}
BEST = 5  # rows of a scene on the page of its dataset
Number = tuple[Committed, Scene, Entry]


def nav(folder: str) -> list[Any]:
    """Entries of the navigation below a folder, the list of all first."""
    return [
        {f"All {folder.removesuffix('/')}": f"{folder}index.md"},
        *({info.name: f"{folder}{info.name}.md"} for info in _infos(FOLDERS[folder])),
    ]


def pages() -> Iterator[tuple[str, str]]:
    """Path and text of each page."""
    for folder, kind in FOLDERS.items():
        infos = _infos(kind)
        rows = [(f"[`{info.name}`]({info.name}.md)", info.summary, _flags(info)) for info in infos]
        listed = _table(("Name", "What it is", ""), rows)
        yield f"{folder}index.md", f"# {kind.capitalize()}s\n\n{INTRODUCTION[kind]}\n\n{listed}"
        for info in infos:
            yield f"{folder}{info.name}.md", _page(info)


INTRODUCTION = {
    "method": "Every method is one file in `methods/`. Its page has what its docstring says (the objective, the steps, "
    "the source and every deviation), its parameters, and what was measured.",
    "dataset": "Every source of graphs is one file in `datasets/`. Its page has its docstring, its parameters, and "
    "what was measured on it.",
}


def _infos(kind: str) -> list[Info]:
    return sorted(catalog(kind), key=lambda info: info.name)


def _flags(info: Info) -> str:
    words = {"robust": "robust", "certifies": "certificate"}
    return ", ".join(word for fact, word in words.items() if info.facts.get(fact))


def _page(info: Info) -> str:
    module = info.cls.__module__.removeprefix("bench.")
    cited = "\n\n".join(f"```bibtex\n{entry}\n```" for entry in references(info).values())
    parts = [
        f"# {info.title}",
        _table(("Name", f"`{info.name}`"), _facts(info, module)),
        f"::: {module}.{info.cls.__name__}\n    options:\n      members: false\n      show_root_heading: false\n"
        "      show_bases: false\n      show_root_toc_entry: false",
        "## Measured",
        _measured(info),
        *(["## References", cited] if cited else []),
    ]
    return "\n\n".join(parts) + "\n"


def _facts(info: Info, module: str) -> Iterator[tuple[str, str]]:
    yield "File", f"`{module.replace('.', '/')}.py`"
    yield "Defaults", f"`{selection.format_selection(info.name, info.defaults())}`"
    if info.requires:
        yield "Needs", ", ".join(f"`{name}`" for name in info.requires)
    if isinstance(info, MethodInfo):
        yield "Robust", "yes" if info.facts["robust"] else "no"
        yield "Certificate of optimality", "yes" if info.facts["certifies"] else "no"
        yield "Uses besides rotations", ", ".join(info.facts["uses"]) or "nothing"
        if info.facts["max_cameras"]:
            yield "Meant for", f"up to {info.facts['max_cameras']} cameras"


def _measured(info: Info) -> str:
    if isinstance(info, DatasetInfo):
        own = [n for n in _numbers() if n[1].dataset == info.name and n[2].ok]
        own = [number for of in _by_scene(own) for number in of[:BEST]]
        said = f"The {BEST} lowest median errors on each scene"
    else:
        own = [number for number in _numbers() if number[2].method == info.name]
        said = "What the committed runs say"
    if not own:
        return "No committed run has numbers of it."
    head = ("Scene", "Method", "Protocol", "Alignment", "Mean °", "Median °", "Time s", "Run")
    link = "../leaderboard/index.html"
    return f"{said}; all are on the [leaderboard]({link}).\n\n{_table(head, map(_row, own))}"


def _by_scene(numbers: Iterable[Number]) -> list[list[Number]]:
    found: dict[tuple[str, ...], list[Number]] = {}
    for number in numbers:
        found.setdefault((number[0].name, *number[1].place), []).append(number)
    return [sorted(of, key=lambda n: n[2].value("median_deg").mean) for of in found.values()]


@cache
def _numbers() -> tuple[Number, ...]:
    return tuple(
        (table, scene, entry)
        for table in board.committed()
        for scene in table.scenes
        for entry in scene.entries
        if scene.has_truth
    )


def _row(number: Number) -> tuple[str, ...]:
    table, scene, entry = number
    mean, median, time = (entry.value(name).mean for name in ("mean_deg", "median_deg", "solve_s"))
    written = (degrees(mean), degrees(median), seconds(time)) if entry.ok else (entry.failure, "–", "–")
    link = f"[{table.name}](../leaderboard/{run_link(table)})"
    return (spoken(scene), f"`{entry.label}`", scene.protocol, scene.alignment, *written, link)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)
