"""Why a measured number is not the published one: toggle every choice, one at a time, and see which closes the gap."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bench.core import outcome
from bench.core.errors import InputError, suggestion
from bench.papers.computed import extended, label, spelled
from bench.papers.items.scenes import SceneTable
from bench.papers.measure import CHOICES, Answer, Measure
from bench.papers.published import SCENE, methods_of
from bench.plugins import selection
from bench.storage.store import Store
from bench.suite.experiment import Suite
from bench.suite.plan import Job

if TYPE_CHECKING:
    import pandas as pd

PROTOCOLS = ("truth-subgraph", "component")
NOTICED_DEG = 1e-4  # a gap that shrinks by less has not been closed
FORM = "SCENE/COLUMN, such as 'Ellis Island/L1-IRLS'"


@dataclass(frozen=True)
class Setting:
    """All that a measured number depends on: a method's selection, a protocol and how errors become a number."""

    method: str
    protocol: str
    measure: Measure


@dataclass(frozen=True)
class Switch:
    """One choice, as it is and as it could be; the setting differs in nothing else."""

    name: str
    before: str
    after: str
    setting: Setting


@dataclass(frozen=True)
class Explained:
    """One cell, bisected.

    Parameters
    ----------
    scene, column
        The cell.
    published
        As printed.
    measured
        Ours, in degrees.
    rows
        ``switch, before, after, measured, published, difference, gap_before, gap_after, status``, a row for each single
        switch.
    """

    scene: str
    column: str
    published: str
    measured: float
    rows: "pd.DataFrame"

    def sentence(self) -> str:
        """Which single switch moves our number closest to the published one, or that none does."""
        cell = f"{self.scene} / {self.column}"
        if not np.isfinite(self.measured):
            return f"{cell}: nothing was measured, so there is no gap to explain."
        gap = abs(self.measured - float(self.published))
        start = f"{cell}: measured {self.measured:.3f}, published {self.published}, gap {gap:.3f}."
        if self._prints_alike(self.measured):
            start += " They agree in the digits that are printed."
        tried = f"of {len(self.rows)} single switches"
        reached = self.rows.dropna(subset=["gap_after"])
        if reached.empty or gap - reached["gap_after"].min() < NOTICED_DEG:
            return f"{start} None {tried} brings them closer."
        best = reached.loc[reached["gap_after"].idxmin()]
        there = "which prints as published" if self._prints_alike(best["measured"]) else "which is not there yet"
        share = 1 - best["gap_after"] / gap
        return (
            f"{start} Closest, {tried}: {best['switch']} {best['before']} -> {best['after']} gives "
            f"{best['measured']:.3f}, {there} ({share:.0%} of the gap closed)."
        )

    def _prints_alike(self, value: float) -> bool:
        digits = len(self.published.partition(".")[2])
        return f"{value:.{digits}f}" == self.published


def switches(setting: Setting, methods: Sequence[str], protocols: Sequence[str] = PROTOCOLS) -> Iterator[Switch]:
    """Every way to change one choice of a setting.

    Parameters
    ----------
    setting
        Where we stand.
    methods
        Selections that could stand for the same column.
    protocols
        That the dataset knows; none where it has no such parameter.
    """
    for method in methods:
        if method != setting.method:
            yield Switch("method", setting.method, method, replace(setting, method=method))
    for protocol in protocols:
        if protocol != setting.protocol:
            yield Switch("protocol", setting.protocol, protocol, replace(setting, protocol=protocol))
    for name, choices in CHOICES.items():
        before = getattr(setting.measure, name)
        for choice in choices:
            if choice != before:
                measure = replace(setting.measure, **{name: choice})
                yield Switch(name, before, choice, replace(setting, measure=measure))


def explain(
    scene: str,
    column: str,
    published: str,
    setting: Setting,
    tried: Sequence[Switch],
    answers: Callable[[str, str], tuple[Sequence[Answer], str]],
) -> Explained:
    """Measure a cell as it stands and under every switch; nothing is run.

    Parameters
    ----------
    scene, column, published
        The cell, and its number as printed.
    setting, tried
        How we measure it, and what could be otherwise.
    answers
        Gives, for a method and a protocol, an estimate with its instance for each seed that ended well, and a status.
    """
    import pandas as pd

    ours = setting.measure.of(answers(setting.method, setting.protocol)[0])
    target = float(published)
    rows = []
    for switch in tried:
        found, status = answers(switch.setting.method, switch.setting.protocol)
        if not _applies(switch, found):
            continue
        value = switch.setting.measure.of(found)
        rows.append(
            {
                "switch": switch.name,
                "before": switch.before,
                "after": switch.after,
                "measured": value,
                "published": published,
                "difference": value - target,
                "gap_before": abs(ours - target),
                "gap_after": abs(value - target),
                "status": status,
            }
        )
    return Explained(scene, column, published, ours, pd.DataFrame(rows))


def _applies(switch: Switch, answers: Sequence[Answer]) -> bool:
    """A pick among checkpoints needs some, one among seeds needs several."""
    if switch.name == "checkpoint":
        return any(estimate.checkpoints for estimate, _ in answers)
    return switch.name != "seeds" or len(answers) > 1


def together(explained: Sequence[Explained]) -> Iterator[str]:
    """For each column of which several cells were explained, the switch that leaves the smallest gap over all of them.

    What closes one gap may do so by chance, and open the others.
    """
    import pandas as pd

    for column in dict.fromkeys(one.column for one in explained):
        own = [one for one in explained if one.column == column and np.isfinite(one.measured)]
        if len(own) < 2:
            continue
        rows = pd.concat([one.rows for one in own])
        gaps = rows.groupby(["switch", "before", "after"], sort=False)["gap_after"].agg(["mean", "count"])
        gaps = gaps[gaps["count"] == len(own)]
        before = float(np.mean([abs(one.measured - float(one.published)) for one in own]))
        start = f"{column}, {len(own)} scenes together: mean gap {before:.3f}."
        if gaps.empty or before - gaps["mean"].min() < NOTICED_DEG:
            yield f"{start} No single switch makes it smaller."
            continue
        name, old, new = gaps["mean"].idxmin()
        yield f"{start} The switch that leaves least: {name} {old} -> {new}, {gaps['mean'].min():.3f}."


def cells(text: str, table: SceneTable, published: Sequence[Mapping[str, str]]) -> list[tuple[str, str]]:
    """Scene and column, in the paper's spelling, of the cells that a name stands for.

    ``Ellis Island/L1-IRLS`` is one; ``Ellis/L1-IRLS/DMF-Synch`` two, for the start of a name will do where it is
    unique; ``Ellis_Island`` every measured column. Case, spaces, hyphens and underscores do not matter.

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


def suites_of(table: SceneTable, scene: str, column: str, name: str) -> tuple[Suite, ...]:
    """What has to run to explain a cell: every candidate as the table has it, ours under the other protocols.

    Parameters
    ----------
    table, scene, column
        The cell, as `cells` spells it.
    name
        Of the suites.
    """
    data = extended(table.dataset, {table.scene_parameter: table.scenes[scene]})
    limits = table.seeds, table.timeout_s, table.memory_gib
    wanted = [(data, candidates(table, column))]
    wanted += [(extended(data, {"protocol": other}), candidates(table, column)[:1]) for other in _other(table)]
    return tuple(Suite(name, table.title, (dataset,), methods, *limits) for dataset, methods in wanted)


def explain_cell(
    table: SceneTable, scene: str, column: str, published: str, alignment: str, jobs: Sequence[Job], store: Store
) -> Explained:
    """Explain a cell from what is stored; nothing is run.

    Parameters
    ----------
    table, scene, column
        The cell, as `cells` spells it.
    published, alignment
        Its number as printed, and the rule that it is measured by.
    jobs, store
        The jobs of `suites_of`, and where their estimates are.
    """

    def answers(method: str, protocol: str) -> tuple[Sequence[Answer], str]:
        found, status = [], []
        for job in jobs:
            if spelled(job) == method and _protocol(job.dataset) == protocol:
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
    return str(selection.parse(dataset).combinations()[0].get("protocol", ""))


def _other(table: SceneTable) -> tuple[str, ...]:
    """Protocols besides the table's; none where its dataset has no such parameter."""
    own = _protocol(table.dataset)
    return tuple(protocol for protocol in PROTOCOLS if own and protocol != own)
