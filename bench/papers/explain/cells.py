"""Which cells of a table are explained: their names, what has to run for them, and their explanation."""

import re
from collections.abc import Iterator, Mapping, Sequence

from bench.core import outcome
from bench.core.errors import InputError, suggestion
from bench.papers.computed import extended, label
from bench.papers.explain.measure import Answer, Measure
from bench.papers.explain.switches import Explained, Setting, explain, switches
from bench.papers.item import Item
from bench.papers.kinds.scenes.table import SceneTable
from bench.papers.layout import Layout
from bench.papers.make import Planned, Runner, plan
from bench.papers.published import SCENE, methods_of, read_published
from bench.plugins import selection
from bench.plugins.catalog import catalog
from bench.plugins.configure import choices
from bench.running.run import Options
from bench.storage.store import Store
from bench.suite.experiment import Suite
from bench.suite.plan import Job

PROTOCOL = "protocol"  # the parameter by which a dataset chooses the cameras
FORM = "SCENE/COLUMN, such as 'Some scene/Some method'"


def plans(layout: Layout, item: Item, names: Sequence[str], options: Options) -> dict[tuple[str, str], Planned]:
    """What has to run for each of the cells that the names stand for, by scene and column; see `cells`.

    Raises
    ------
    InputError
        Where the item is no table of scenes, a name is wrong, or the scene is not on disk.
    """
    if not isinstance(item, SceneTable):
        raise InputError("--explain takes a table of scenes")
    published = read_published(layout.sources.published, item.published)
    item.check(published)
    found: dict[tuple[str, str], Planned] = {}
    taken: set[str] = set()
    for scene, column in dict.fromkeys(cell for name in names for cell in cells(name, item, published)):
        planned = plan(_suites(item, scene, column, layout.name), options, taken)
        if not planned.runs:
            raise InputError(f"--explain '{scene}': {'; '.join(planned.missing)}")
        found[scene, column] = planned
    return found


def explanations(
    layout: Layout, item: Item, planned: Mapping[tuple[str, str], Planned], alignment: str | None, run: Runner
) -> Iterator[Explained]:
    """Run what is not done for each cell, then explain it.

    Parameters
    ----------
    layout, item, planned
        The paper, its table of scenes, and what `plans` found for it.
    alignment
        In place of the item's own.
    run
        Prepares and executes a planned run.
    """
    assert isinstance(item, SceneTable)
    published = read_published(layout.sources.published, item.published)
    for (scene, column), of_cell in planned.items():
        of_cell.execute(run)
        jobs = [cell.job for part in of_cell.runs for cell in part.cells]
        printed = next(row[column] for row in published if row[SCENE] == scene)
        store = of_cell.runs[0].store
        yield _explained(item, scene, column, printed, alignment or item.alignment, jobs, store)


def cells(text: str, table: SceneTable, published: Sequence[Mapping[str, str]]) -> list[tuple[str, str]]:
    """Scene and column, in the paper's spelling, of the cells that a name stands for.

    ``Scene/Column`` is one; ``Scene/Column/Other`` two; ``Scene`` every measured column. The start of a name will do
    where it is unique; case, spaces, hyphens and underscores do not matter.

    Raises
    ------
    InputError
        Where a scene or a column is unknown, or the cell has nothing measured or nothing published.
    """
    first, *rest = (part.strip() for part in text.split("/"))
    scene = _named(first, {name: name for name in table.scenes} | {o: p for p, o in table.scenes.items()}, "scene")
    row = next((row for row in published if row[SCENE] == scene), None)
    if row is None:
        raise InputError(f"--explain '{text}': {table.published} has no row for '{scene}'")
    measured = [c for c in methods_of(list(map(dict, published))) if table.measured.get(c)]
    columns = {name: name for name in methods_of(list(map(dict, published)))}
    chosen = [_named(part, columns, "column") for part in rest] or [c for c in measured if row[c]]
    for column in chosen:
        if column not in measured:
            raise InputError(
                f"--explain '{text}': column '{column}' is published only; measured are {', '.join(measured)}"
            )
        if not row[column]:
            raise InputError(f"--explain '{text}': the paper prints no number there")
    return [(scene, column) for column in chosen]


def _named(text: str, names: Mapping[str, str], kind: str) -> str:
    def plain(name: str) -> str:
        return re.sub(r"[\W_]", "", name).lower()

    wanted = plain(text)
    exact = {full for name, full in names.items() if plain(name) == wanted}
    found = exact or {full for name, full in names.items() if wanted and plain(name).startswith(wanted)}
    if len(found) == 1:
        return found.pop()
    if found:
        raise InputError(f"--explain: {kind} '{text}' may be {' or '.join(sorted(found))}; the form is {FORM}")
    raise InputError(f"--explain: the table has no {kind} '{text}'{suggestion(text, names)}; the form is {FORM}")


def _suites(table: SceneTable, scene: str, column: str, name: str) -> tuple[Suite, ...]:
    """What has to run to explain a cell: every candidate as the table has it, ours under the other protocols."""
    data = extended(table.dataset, {table.scene_parameter: table.scenes[scene]})
    wanted = [(data, candidates(table, column))]
    wanted += [(extended(data, {PROTOCOL: other}), candidates(table, column)[:1]) for other in _other(table)]
    return tuple(table.suite(name, [dataset], methods) for dataset, methods in wanted)


def _explained(
    table: SceneTable, scene: str, column: str, published: str, alignment: str, jobs: Sequence[Job], store: Store
) -> Explained:
    """Explain a cell, by its number as printed, from what is stored of the jobs of `_suites`; nothing is run."""

    def answers(method: str, protocol: str) -> tuple[Sequence[Answer], str]:
        found, status = [], []
        for job in jobs:
            if job.label == method and _protocol(job.dataset) == protocol:
                record = store.record(job.id)
                status.append(record.outcome.text if record else outcome.NOT_RUN)
                if record and record.outcome.ok:
                    found.append((store.estimate(job.id), store.instance(job.instance_key)))
        return found, "; ".join(dict.fromkeys(status)) or outcome.NOT_RUN

    methods = [label("method", text) for text in candidates(table, column)]
    measure = Measure(alignment=alignment, statistic=table.statistic.removesuffix("_deg"))
    setting = Setting(methods[0], _protocol(table.dataset), measure)
    return explain(scene, column, published, setting, list(switches(setting, methods, _other(table))), answers)


def candidates(table: SceneTable, column: str) -> tuple[str, ...]:
    """Selections that could stand for a column: first what the table measures for it, then its variants."""
    return tuple(dict.fromkeys((*table.measured[column], *table.variants.get(column, ()))))


def _protocol(dataset: str) -> str:
    """The protocol that a dataset's selection names, "" where it names none."""
    return str(selection.parse(dataset).combinations()[0].get(PROTOCOL, ""))


def _other(table: SceneTable) -> tuple[str, ...]:
    """Protocols besides the table's; none where it names none."""
    own = _protocol(table.dataset)
    known = choices(catalog("dataset")[selection.parse(table.dataset).name].cls, PROTOCOL) if own else ()
    return tuple(str(protocol) for protocol in known if protocol != own)
