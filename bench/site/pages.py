"""The folder of pages: the leaderboard, one page a method, where every table comes from, and the tables themselves."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.core.errors import InputError
from bench.core.words import counted
from bench.plugins.catalog import catalog
from bench.plugins.declare import MethodInfo
from bench.plugins.references import references
from bench.reporting.html.document import asset, document
from bench.reporting.html.section import Table, Value, anchor
from bench.reporting.html.words import enumeration, spoken, what_was_compared
from bench.reporting.tables.printed import degrees, seconds
from bench.reporting.tables.rows import Entry, Scene
from bench.reporting.tables.standing import overall
from bench.site.board import RUNS, board, method_pages, run_link
from bench.site.committed import Committed
from bench.site.picture import Picture, picture

PACKAGE = "bench.site"
INDEX = "index.html"
MARK = ".rotsync-bench-site"  # is in every folder that was written here, so that no other is emptied


@dataclass(frozen=True)
class Number:
    """What a table says of a configured method on one scene."""

    table: Committed
    scene: Scene
    entry: Entry

    @property
    def cells(self) -> tuple[Value, ...]:
        """As the page of the method shows it; the run follows, with its link."""
        values = [self.entry.value(name).mean for name in ("mean_deg", "median_deg", "solve_s")]
        written = [degrees(values[0]), degrees(values[1]), seconds(values[2])]
        ended = written if self.entry.ok else [self.entry.failure, "–", "–"]
        where = (spoken(self.scene), self.entry.label, self.scene.protocol, self.scene.alignment)
        return (self.table.provenance.suite, *where, *ended)


def write_site(tables: Sequence[Committed], folder: Path, title: str) -> Path:
    """Write the site; what an earlier call has written there is replaced.

    Parameters
    ----------
    tables
        What `bench.site.committed.read_all` found; the one with most methods is in the picture.
    folder
        New, empty, or of an earlier site.
    title
        Of the leaderboard.

    Returns
    -------
    The page to open.

    Raises
    ------
    InputError
        Where the folder holds something else.
    """
    if folder.exists() and (not folder.is_dir() or (any(folder.iterdir()) and not (folder / MARK).exists())):
        raise InputError(f"{folder} holds something other than a site; choose another folder with --out")
    pages = rendered(tables, title)
    shutil.rmtree(folder, ignore_errors=True)
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="")
    return folder / INDEX


def rendered(tables: Sequence[Committed], title: str) -> dict[str, str]:
    """Text of every file of the site, by its path in the folder."""
    newest = sorted(tables, key=lambda table: table.provenance.finished, reverse=True)
    shown = _pictured(newest)
    newest.sort(key=lambda table: table is not shown)
    found = {MARK: "", INDEX: _index(newest, title), RUNS: _runs(newest)}
    known = {info.name: info for info in catalog("method")}
    for method, path in method_pages(newest).items():
        found[path] = _method(method, known.get(method), newest)
    for table in newest:
        found[_data(table)] = table.results.frame.to_csv(index=False, lineterminator="\n")
    return found


def _data(table: Committed) -> str:
    return f"data/{anchor(table.name)}.csv"


def _index(tables: Sequence[Committed], title: str) -> str:
    scenes, standings = overall(tables[0].results.frame, tables[0].results.ties)
    drawn = picture(standings)
    return _page(
        INDEX,
        title=title,
        picture=drawn,
        sentences=[what_was_compared(scenes), *([_leaders(drawn)] if drawn else [])],
        runs=[(t, run_link(t)) for t in tables],
        facts=_facts(tables),
        data={"leaderboard": board(tables)},
        scripts=("leaderboard.js",),
    )


def _pictured(tables: Sequence[Committed]) -> Committed:
    """The table with most methods that ended well on all of its scenes."""

    def points(table: Committed) -> int:
        drawn = picture(overall(table.results.frame, table.results.ties)[1])
        return len(drawn.points) if drawn else 0

    return max(tables, key=points)


def _leaders(drawn: Picture) -> str:
    best = sorted(drawn.points, key=lambda point: point.degrees)[:3]
    named = enumeration([f"{point.label} ({degrees(point.degrees)}°)" for point in best])
    return f"The lowest median errors, as geometric means over the scenes with ground truth: {named}."


def _facts(tables: Sequence[Committed]) -> str:
    methods = counted(len(method_pages(tables)), "method")
    scenes = {(s.dataset, s.instance) for t in tables for s in t.scenes}
    rows = sum(len(table.results.frame) for table in tables)
    return f"{methods}, {counted(len(scenes), 'scene')}, {counted(rows, 'scored job')} in {counted(len(tables), 'run')}"


def _runs(tables: Sequence[Committed]) -> str:
    entries = [(anchor("run", table.name), table, _data(table), _origin(table)) for table in tables]
    return _page(RUNS, title="Where the numbers come from", entries=entries)


def _origin(table: Committed) -> list[tuple[str, tuple[str, ...]]]:
    own = table.provenance
    protocols = tuple(dict.fromkeys(table.results.frame["protocol"]))
    facts = [
        ("Suite", (own.suite,)),
        ("Protocol", protocols),
        ("Alignment", (table.results.alignment,)),
        ("Finished", (own.finished,)),
        ("Benchmark", (" ".join(filter(None, (own.version, own.commit))),)),
        ("Machine", own.machine),
        ("Packages", own.packages),
        ("Notes", own.notes),
    ]
    return [(name, values) for name, values in facts if any(values)]


def _method(method: str, info: MethodInfo | None, tables: Sequence[Committed]) -> str:
    numbers = [
        Number(table, scene, entry)
        for table in tables
        for scene in table.scenes
        for entry in scene.entries
        if entry.method == method
    ]
    places: dict[tuple[str, ...], list[Number]] = {}
    for number in numbers:  # the newest first
        suite = number.table.provenance.suite
        places.setdefault((suite, *number.scene.place, number.scene.alignment, number.entry.params), []).append(number)
    return _page(
        "methods/",
        title=numbers[0].entry.title,
        method=method,
        info=info,
        references=references(info) if info else {},
        numbers=[(own[0].cells, own[0].table.name, run_link(own[0].table)) for own in places.values()],
        history=_history(places),
        template="method.html",
        up="../",
    )


def _history(places: Mapping[tuple[str, ...], Sequence[Number]]) -> Table | None:
    """Median errors by version, where there are several of a number."""
    several = {place: own for place, own in places.items() if len(own) > 1}
    if not several:
        return None
    versions = sorted({number.table.release for own in several.values() for number in own})
    rows = []
    for own in several.values():
        of = {number.table.release: number for number in own}
        medians = [degrees(of[v].entry.value("median_deg").mean) if v in of else "–" for v in versions]
        rows.append((*own[0].cells[:5], *medians))
    return Table(
        "Median error in degrees by version of the benchmark, and the day of the run",
        ("Suite", "Scene", "Method", "Protocol", "Alignment", *versions),
        tuple(rows),
    )


def _page(path: str, *, scripts: Sequence[str] = (), template: str = "", up: str = "", **content: object) -> str:
    own = [asset("theme.js"), asset("common.js"), *map(asset, scripts)]
    data = content.pop("data", {})
    assert isinstance(data, dict)
    return document(
        template or path,
        package=PACKAGE,
        scripts=own,
        data=data,
        up=up,
        own_style=asset("site.css", PACKAGE),
        **content,
    )
