"""One method of a run against others of the same run: who wins on each scene and over all, and what nobody can tell."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from bench.core.errors import InputError, suggestion
from bench.core.outcome import OK
from bench.core.words import counted
from bench.plugins.selection import label, parse
from bench.scoring.inference.blocks import DID_NOT_RUN, headline
from bench.scoring.inference.statistics import MIN_COVERAGE
from bench.scoring.paired import (
    IDENTICAL,
    NOWHERE,
    STATISTICS,
    Cell,
    Job,
    Row,
    jobs_of,
    judged,
    of_methods,
    of_scenes,
)
from bench.scoring.results import Configured, Place, Results

if TYPE_CHECKING:
    import pandas as pd

Standing = Literal["win", "tie", "loss"]

WIN: Standing = "win"
TIE: Standing = "tie"
LOSS: Standing = "loss"
OVERALL, SCENE = "overall", "scene"
WORDS: Mapping[str, Standing] = {"better": WIN, "worse": LOSS, "cannot tell": TIE, IDENTICAL: TIE}
COLUMNS = (
    *("level", "dataset", "instance", "protocol", "method", "params", "quantity"),
    *("own", "other", "ratio", "low", "high", "p_value", "p_holm", "verdict", "wins", "ties", "losses", "why"),
)
FAILED, FEWER, MORE = "failed", "fewer cameras", "the other: failed or fewer cameras"


@dataclass(frozen=True, eq=False)
class Contest:
    """A method against others.

    Parameters
    ----------
    method, others
        The configured methods.
    rows
        `COLUMNS`, where method and params are the other's, `own` and `other` the two values, and `ratio` is own to
        other with its 95 % interval: below 1 the method is better. Level "scene" is a scene, "overall" all of them,
        by geometric means; there `wins`, `ties` and `losses` count the scenes' verdicts. A quantity is "median", "mean"
        or, of a timing run, "time". `why` says of a verdict what decided it in place of the ratio; "" for none.
    scenes
        How many there are.
    notes
        What is not compared, and why.
    """

    method: Configured
    others: tuple[Configured, ...]
    rows: "pd.DataFrame"
    scenes: int
    notes: tuple[str, ...]


def contest(results: Results, methods: Sequence[str], threshold: float = 1.05) -> Contest:
    """Compare one method of a run with others on the problems that it has of both.

    Ratios, their intervals and p values are those of `bench.scoring.comparison.compare`: on a scene from a paired
    bootstrap over cameras and Student's t over seeds, over scenes from Student's t on the logarithms of the ratios. The
    p values of all methods and quantities are corrected together (Holm), then for the two levels.

    Where one of the two scored fewer than 95 % as many cameras of a scene as the other, because it failed or left them
    out, it loses there whatever its ratio is; and it cannot win over all scenes, for a mean over easier ones would
    flatter it.

    Parameters
    ----------
    results
        A scored run; of its protocols the first, where a scene was run under several.
    methods
        Selections of methods in the run, the first against each other; of one alone, against all others.
    threshold
        A ratio between 1 / threshold and threshold is a tie.

    Raises
    ------
    InputError
        On a method that the run has not, and where there is nothing to compare.
    """
    import pandas as pd

    frame = headline(results.frame)
    own, others = _chosen(frame, methods)
    ids = set(frame["job"])
    chosen = {own, *others}
    jobs = {cell: job for cell, job in jobs_of(results).items() if job.row["job"] in ids and cell[3:5] in chosen}
    able = {cell: job for cell, job in jobs.items() if job.errors is not None and job.ended not in DID_NOT_RUN}
    pairs = _pairs(able, own, others)
    if not any(_scored(job) for pair in pairs.values() for job in pair):
        raise InputError(
            f"{label(*own)} and the others have no problem with ground truth in common: nothing to compare"
        )
    uncovered = _uncovered(pairs)
    ratios = of_scenes(pairs, with_times=True)
    scenes = len({cell[:3] for cell in pairs})
    levels = 2 if scenes > 1 else 1
    by_scene = [*_scene_rows(judged(SCENE, ratios, threshold, levels), uncovered)]
    overall = [*_overall_rows(judged(OVERALL, of_methods(ratios), threshold, levels), by_scene)]
    rows = pd.DataFrame([*overall, *by_scene], columns=list(COLUMNS))
    return Contest(own, others, rows, scenes, tuple(_notes(results, frame, jobs, pairs)))


def _chosen(frame: "pd.DataFrame", methods: Sequence[str]) -> tuple[Configured, tuple[Configured, ...]]:
    """The method, and the others that it is compared with."""
    known: list[Configured] = list(dict.fromkeys(zip(frame["method"], frame["params"], strict=True)))
    if not methods:
        raise InputError("name the method that is compared, and those that it is compared with")
    own, *others = dict.fromkeys(_found(text, known) for text in methods)
    against = tuple(others or (one for one in known if one != own))
    if not against:
        raise InputError(f"{label(*own)} is the only method here: name another that it is compared with")
    return own, against


def _found(text: str, known: Sequence[Configured]) -> Configured:
    """The configured method that a selection is; the bare name also means the one configuration that there is."""
    selection = parse(text)
    if any(len(values) > 1 for _, values in selection.grid):
        raise InputError(f"{text}: name one configuration, not a grid")
    alike = [one for one in known if one[0] == selection.name]
    same = [one for one in alike if dict(parse(label(*one)).grid) == dict(selection.grid)]
    if same or (len(alike) == 1 and not selection.grid):
        return (same or alike)[0]
    raise InputError(f"the run has no method '{text}'{suggestion(text, [label(*one) for one in alike or known])}")


def _pairs(jobs: Mapping[Cell, Job], own: Configured, others: Sequence[Configured]) -> dict[Cell, tuple[Job, Job]]:
    """Jobs of another method and of `own` on the same problem and seed, by the former's cell.

    On one instance a deterministic method ran once, and would have done the same under every seed.
    """
    found: dict[Cell, tuple[Job, Job]] = {}
    by_seed: dict[tuple[Place, Configured], dict[int, Job]] = {}
    for (dataset, instance, protocol, method, params, seed), job in jobs.items():
        by_seed.setdefault(((dataset, instance, protocol), (method, params)), {})[seed] = job
    for (place, configured), theirs in by_seed.items():
        ours = by_seed.get((place, own), {})
        if configured in others and ours:
            one_instance = len({job.row["instance_key"] for job in (*theirs.values(), *ours.values())}) == 1
            for seed in sorted({*theirs, *ours}):
                a, b = (_of_seed(side, seed, one_instance) for side in (theirs, ours))
                if a and b and a.row["instance_key"] == b.row["instance_key"]:
                    found[(*place, *configured, seed)] = (a, b)
    return dict(sorted(found.items(), key=lambda item: others.index(item[0][3:5])))


def _of_seed(side: Mapping[int, Job], seed: int, one_instance: bool) -> Job | None:
    return side.get(seed) or (next(iter(side.values())) if one_instance and len(side) == 1 else None)


def _scored(job: Job) -> int:
    """How many cameras of it were scored."""
    return int(np.isfinite(job.errors).sum()) if job.ended == OK and job.errors is not None else 0


def _uncovered(pairs: Mapping[Cell, tuple[Job, Job]]) -> dict[tuple[Place, Configured], tuple[Standing, str]]:
    """Scenes and other methods where coverage decides, with the verdict and the reason."""
    totals: dict[tuple[Place, Configured], tuple[int, int]] = {}
    for (dataset, instance, protocol, method, params, _), (other, own) in pairs.items():
        key: tuple[Place, Configured] = ((dataset, instance, protocol), (method, params))
        theirs, ours = totals.get(key, (0, 0))
        totals[key] = theirs + _scored(other), ours + _scored(own)
    found: dict[tuple[Place, Configured], tuple[Standing, str]] = {}
    for key, (theirs, ours) in totals.items():
        if ours < MIN_COVERAGE * theirs:
            found[key] = LOSS, FEWER if ours else FAILED
        elif theirs < MIN_COVERAGE * ours:
            found[key] = WIN, MORE
    return found


def _scene_rows(
    rows: Iterator[Row], uncovered: Mapping[tuple[Place, Configured], tuple[Standing, str]]
) -> Iterator[Row]:
    """Rows of scenes, with one for each quantity where coverage decides and there is no ratio."""
    left = dict(uncovered)
    for row in rows:
        key = ((row["dataset"], row["instance"], row["protocol"]), (row["method"], row["params"]))
        left.pop(key, None)
        verdict, why = uncovered.get(key, (WORDS[row["verdict"]], ""))
        yield _renamed(row) | {"verdict": verdict, "why": why}
    for (place, method), (verdict, why) in left.items():
        names = dict(zip(COLUMNS, (SCENE, *place, *method), strict=False))
        for quantity in STATISTICS:
            yield names | {"quantity": quantity, "verdict": verdict, "why": why}


def _overall_rows(rows: Iterator[Row], scenes: Sequence[Row]) -> Iterator[Row]:
    """Rows over all scenes with their counts, of each pair of methods and quantity that any scene has."""
    known = {(row["method"], row["params"], row["quantity"]): row for row in rows}
    for key in dict.fromkeys((row["method"], row["params"], row["quantity"]) for row in scenes):
        own = [row for row in scenes if (row["method"], row["params"], row["quantity"]) == key]
        wins, ties, losses = (sum(row["verdict"] == word for row in own) for word in (WIN, TIE, LOSS))
        decided = {row["verdict"] for row in own if row["why"]}
        whole = {"wins": wins, "ties": ties, "losses": losses, "why": ""}
        if key not in known:
            names = dict(zip(COLUMNS, (OVERALL, *NOWHERE, *key), strict=False))
            yield names | whole | {"verdict": decided.pop() if len(decided) == 1 else TIE, "why": FAILED}
            continue
        word = WORDS[known[key]["verdict"]]
        withheld = {WIN: LOSS, LOSS: WIN}.get(word) in decided
        yield _renamed(known[key]) | whole | {"verdict": TIE if withheld else word, "why": FEWER if withheld else ""}


def _renamed(row: Row) -> Row:
    return {{"old": "other", "new": "own"}.get(name, name): value for name, value in row.items()}


def _notes(
    results: Results, frame: "pd.DataFrame", jobs: Mapping[Cell, Job], pairs: Mapping[Cell, tuple[Job, Job]]
) -> Iterator[str]:
    if len(frame) < len(results.frame):
        yield f"only protocol {frame['protocol'].iloc[0]}: a scene under another one is not independent of it"
    paired = {job.row["job"] for pair in pairs.values() for job in pair}
    left = [job for job in jobs.values() if job.row["job"] not in paired]
    blind = [job for job in left if job.errors is None]
    idle = [job for job in left if job.errors is not None and job.ended in DID_NOT_RUN]
    alone = len(left) - len(blind) - len(idle)
    for count, why in ((len(blind), "no ground truth"), (len(idle), "not been run"), (alone, "no counterpart")):
        if count:
            yield f"{counted(count, 'job')} {'has' if count == 1 else 'have'} {why}: not compared"
