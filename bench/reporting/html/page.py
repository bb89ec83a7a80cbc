"""The whole page: gathers the sections, embeds data, style, script and plotly, and writes one file."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from bench.core.words import counted
from bench.reporting import appearance
from bench.reporting.figures.errors import Run
from bench.reporting.figures.looks import looks_by_selection
from bench.reporting.html import overview, reversals, words
from bench.reporting.html.document import asset, document
from bench.reporting.html.embed import compact
from bench.reporting.html.failures import failures, notes
from bench.reporting.html.leaderboard import leaderboard
from bench.reporting.html.origin import origin
from bench.reporting.html.scene import sections as forensics
from bench.reporting.html.section import Section, anchor
from bench.reporting.tables.rows import Scene, is_timed
from bench.reporting.tables.rows import scenes as scenes_of
from bench.reporting.tables.standing import overall
from bench.scoring.inference.dominance import clearly_better
from bench.scoring.results import Results
from bench.storage.store import Store

FILE_NAME = "report.html"


@dataclass(frozen=True)
class ScenePage:
    """The folded part of the page that is about one scene."""

    id: str
    title: str
    facts: str
    sections: tuple[Section, ...]


def write_report(store: Store, by_rule: Mapping[str, Results], path: Path) -> Path:
    """Write the report of a run to a file.

    Parameters
    ----------
    store
        The run.
    by_rule
        The run scored under one or more alignment rules, see `bench.scoring.results`; the report is about
        the first, the others are in the leaderboard and tell whether the choice matters.
    path
        The file, replaced where it exists.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f"{path.name}.part")
    temporary.write_text(render(store, by_rule), encoding="utf-8")
    temporary.replace(path)
    return path


def render(store: Store, by_rule: Mapping[str, Results]) -> str:
    """Text of the page."""
    wanted = appearance.current()
    by_rule = {rule: replace(found, frame=wanted.ordered(found.frame)) for rule, found in by_rule.items()}
    results = next(iter(by_rule.values()))
    by_scene = {rule: scenes_of(r.frame, r.ties) for rule, r in by_rule.items()}
    scenes = by_scene[results.alignment]
    headline, standing = overall(results.frame, results.ties)
    suites = list(dict.fromkeys(plan.suite for plan in store.plans()))
    sections = overview.overall(results, headline, standing)
    pages = _scene_pages(store, results, scenes)
    data = {"leaderboard": leaderboard(by_rule)} | {
        f"figure-{s.id}": compact(s.figure) for s in [*sections, *(s for p in pages for s in p.sections)] if s.figure
    }
    return document(
        "page.html",
        scripts=[asset("theme.js"), _plotly(), *map(asset, ("common.js", "leaderboard.js", "figures.js"))],
        title=f"{', '.join(suites)}: rotation synchronization",
        summary=words.summary(headline, standing, is_timed(results.frame)),
        flags=_flags(by_rule, by_scene, scenes),
        dependence=overview.dependence(by_scene) if len(by_scene) > 1 else None,
        sections=sections,
        scenes=pages,
        failures=failures(store, results.frame),
        notes=notes(scenes),
        footnotes=results.footnotes,
        origin=origin(store, results.frame["job"]),
        data=data,
    )


def _flags(
    by_rule: Mapping[str, Results], by_scene: Mapping[str, Sequence[Scene]], scenes: Sequence[Scene]
) -> list[tuple[bool, str]]:
    """Sentence on each choice that was varied, and whether it matters."""
    found: list[tuple[bool, str]] = []
    better = {rule: {at: clearly_better(own) for at, own in r.errors.items()} for rule, r in by_rule.items()}
    if len(by_scene) > 1 and any(e.scored for s in scenes for e in s.entries):
        found += words.depends("alignment", by_scene, reversals.by_alignment(by_scene, better))
    protocols = list(dict.fromkeys(scene.protocol for scene in scenes))
    if len({(s.dataset, s.instance) for s in scenes}) < len(scenes):
        shared = _under_every(scenes, protocols)
        found += words.depends("protocol", shared, reversals.by_protocol(scenes, next(iter(better.values()))))
    return found


def _under_every(scenes: Sequence[Scene], protocols: Sequence[str]) -> dict[str, list[Scene]]:
    """By protocol, the scenes that were run under each of them."""
    names = Counter((s.dataset, s.instance) for s in scenes)
    both = [s for s in scenes if names[s.dataset, s.instance] == len(protocols)]
    return {protocol: [s for s in both if s.protocol == protocol] for protocol in protocols}


def _scene_pages(store: Store, results: Results, scenes: Sequence[Scene]) -> list[ScenePage]:
    several = len({scene.dataset for scene in scenes}) > 1
    protocols = len({scene.protocol for scene in scenes}) > 1
    run = Run(results.frame, scenes, results.errors, looks_by_selection(results.frame))
    pages = []
    used: set[str] = set()
    for scene in scenes:
        sections = [*overview.of_scene(run, scene, results.curves), *forensics(store, results, scene.place)]
        title = f"{f'{scene.dataset} / ' if several else ''}{words.spoken(scene)}"
        pages.append(
            ScenePage(
                _unique(anchor("scene", *scene.place), used),
                f"{title} ({scene.protocol})" if protocols else title,
                _facts(scene),
                tuple(replace(s, id=_unique(s.id, used)) for s in sections),
            )
        )
    return pages


def _facts(scene: Scene) -> str:
    """One line: cameras, who is best, what failed."""
    best = [e for e in scene.entries if e.best]
    failed = sum(failed.seeds for e in scene.entries for failed in e.failures)
    parts = [counted(scene.cameras, "camera")]
    if best:
        parts.append(f"best: {words.enumeration([e.label for e in best])}")
    if failed:
        parts.append(f"{failed} failed")
    return " · ".join(parts)


def _unique(name: str, used: set[str]) -> str:
    """The name, or the name with a number; two scenes may differ in signs that an id cannot hold."""
    found, k = name, 1
    while found in used:
        k += 1
        found = f"{name}-{k}"
    used.add(found)
    return found


@cache
def _plotly() -> str:
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())
