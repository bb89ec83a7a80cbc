"""The findings of a run in sentences, computed from what the tables say; they claim no more than that.

"Best" is always the tie group of `bench.scoring.results.Results.ties`; "faster" is a geometric mean of ratios over all
scenes that were scored, on every one of which both methods ended well. Pure functions.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from bench.core.words import counted
from bench.reporting.html.reversals import Reversal
from bench.reporting.tables.printed import degrees
from bench.reporting.tables.rows import Entry, Scene
from bench.reporting.tables.standing import Standing, geometric_mean

NEAR_DEG = 0.1  # a method this close to the leader's median, on every scene, is as good for most purposes
FASTER = 2.0  # a ratio of packed times below this is not worth a sentence
NAMED = 4  # names in a list before "and 3 more"


def summary(scenes: Sequence[Scene], standings: Sequence[Standing], timed: bool = False) -> list[str]:
    """What was compared, who is best, who is faster, and what failed, a sentence or two each."""
    first = [what_was_compared(scenes), *who_is_best(scenes, standings), *who_is_faster(scenes, standings, timed)]
    return [*first, what_failed(scenes), *caveats(scenes)]


def what_was_compared(scenes: Sequence[Scene]) -> str:
    """Methods, scenes, rules and seeds."""
    methods = len({e.key for s in scenes for e in s.entries})
    protocols = list(dict.fromkeys(s.protocol for s in scenes))
    datasets = list(dict.fromkeys(s.dataset for s in scenes))
    seeds = max((e.seeds for s in scenes for e in s.entries), default=1)
    instances = len({(s.dataset, s.instance) for s in scenes})
    rules = f"alignment {scenes[0].alignment}, protocol {enumeration(protocols)}" if scenes else ""
    return (
        f"{counted(methods, 'method')} on {counted(instances, 'scene')} of {enumeration(datasets)}, "
        f"{counted(seeds, 'seed')}; {rules}."
    )


def who_is_best(scenes: Sequence[Scene], standings: Sequence[Standing]) -> list[str]:
    """Ties at the top over the scenes with ground truth."""
    known = _known(scenes)
    if not known:
        return ["No scene has ground truth that a method could be scored against: errors are unknown."]
    where = f"On these {len(known)} scenes" if len(known) > 1 else f"On {spoken(known[0])}"
    always = [s for s in standings if len(s.best_on) == len(known)]
    if len(always) > 1:
        names = enumeration([s.label for s in always])
        return [f"{where}, {names} are tied for the best median error: they cannot be told apart from the best."]
    if always:
        alone = [spoken(s) for s in known if [e.label for e in s.entries if e.best] == [always[0].label]]
        if len(alone) == len(known):
            return [f"{where}, {always[0].label} has the best median error, and no other is tied with it."]
        shared = f"alone on {enumeration(alone)}, tied with others elsewhere" if alone else "tied with others on each"
        return [f"{where}, only {always[0].label} is among the best everywhere: {shared}."]
    leading = sorted((s for s in standings if s.best_on), key=lambda s: -len(s.best_on))
    if not leading:
        return [f"{where}, no method ended well."]
    parts = [f"{s.label} on {len(s.best_on)}" for s in leading[:NAMED]]
    rest = f", and {counted(len(leading) - NAMED, 'other method')} on fewer" if len(leading) > NAMED else ""
    named = ", ".join(parts) if rest else enumeration(parts)
    return [f"{where}, no method is among the best everywhere: {named}{rest}."]


def leader(standings: Sequence[Standing]) -> Standing | None:
    """The method that is among the best on most scenes; of several the one with the lowest geometric mean."""
    candidates = [s for s in standings if s.best_on]
    return min(candidates, key=lambda s: (-len(s.best_on), _last(s.median_deg), _last(s.rank)), default=None)


def who_is_faster(scenes: Sequence[Scene], standings: Sequence[Standing], timed: bool = False) -> list[str]:
    """The fastest of the methods that come within `NEAR_DEG` of the leader's median on every scene."""
    first = leader(standings)
    known = _known(scenes)
    if first is None or len(known) == 0:
        return []
    entries = {s.label: _entries(known, s.label) for s in standings}
    base = entries[first.label]
    near = {
        label: ratio
        for label, own in entries.items()
        if label != first.label
        and len(own) == len(base) == len(known)
        and _near(own, base)
        and math.isfinite(ratio := _ratio(base, own))
    }
    how = "" if timed else " (times of a packed run)"
    everywhere = f" on every one of the {len(known)} scenes" if len(known) > 1 else ""
    if not near:
        return [f"No other method comes within {NEAR_DEG:g}° of the median of {first.label}{everywhere}."]
    fastest = max(near, key=lambda label: near[label])
    if near[fastest] >= FASTER:
        return [
            f"{fastest} is {_times(near[fastest])} faster than {first.label}, "
            f"and within {NEAR_DEG:g}° of its median{everywhere}{how}."
        ]
    if near[fastest] <= 1 / FASTER:
        return [
            f"{first.label} is also the fastest of those within {NEAR_DEG:g}° of its median{everywhere}, "
            f"{_times(1 / near[fastest])} faster than the next, {fastest}{how}."
        ]
    return [
        f"No method within {NEAR_DEG:g}° of the median of {first.label}{everywhere} is more than "
        f"{FASTER:g} times faster than it{how}."
    ]


def what_failed(scenes: Sequence[Scene]) -> str:
    """How many jobs did not end well, by outcome."""
    jobs = sum(e.seeds for s in scenes for e in s.entries)
    kinds: Counter[str] = Counter()
    methods: dict[str, dict[str, None]] = {}
    for entry in (e for s in scenes for e in s.entries):
        for failed in entry.failures:
            kinds[failed.outcome] += failed.seeds
            methods.setdefault(failed.outcome, {})[entry.label] = None
    if not kinds:
        return f"All {jobs} jobs ended well." if jobs > 1 else "The job ended well."
    parts = [f"{kind} {times} ({enumeration(list(methods[kind]))})" for kind, times in kinds.most_common()]
    return f"{kinds.total()} of {jobs} jobs did not end well: {'; '.join(parts)}."


def caveats(scenes: Sequence[Scene]) -> list[str]:
    """What the reader must not conclude."""
    found = []
    blind = [spoken(s) for s in scenes if not any(e.scored for e in s.entries)]
    if blind and len(blind) < len(scenes):
        found.append(f"Not scored, for want of ground truth or of a result: {enumeration(blind)}.")
    if scenes and max(e.seeds for s in scenes for e in s.entries) == 1 and _known(scenes):
        found.append(
            "There is one seed: a tie can be trusted, a difference holds for these cameras "
            "and says nothing of other draws."
        )
    return found


def depends(what: str, by_choice: Mapping[str, Sequence[Scene]], found: Sequence[Reversal]) -> list[tuple[bool, str]]:
    """Whether a choice that was varied matters, and a sentence on it: to who is best, and to the order of the others.

    Parameters
    ----------
    what
        "alignment" or "protocol".
    by_choice
        The same scenes under each choice.
    found
        Pairs of methods whose order changes.
    """
    flags = []
    choices_of: dict[tuple[tuple[str, ...], int], list[str]] = {}
    for choice, scenes in by_choice.items():
        choices_of.setdefault(_most_often_best(scenes), []).append(choice)
    if len({names for names, _ in choices_of}) > 1:
        total = len(_known(next(iter(by_choice.values()))))
        parts = [
            f"under {enumeration(choices)} {enumeration(names)}{f' ({times} of {total} scenes)' if total > 1 else ''}"
            for (names, times), choices in choices_of.items()
        ]
        often = "Most often among the best" if total > 1 else "The best"
        flags.append((True, f"Who is best depends on the {what}. {often}: {'; '.join(parts)}."))
    if found:
        flags.append((True, _order_depends(what, found)))
    if not flags:
        same = f"Neither the best methods nor their order depend on the {what} ({enumeration(list(by_choice))})."
        flags.append((False, same))
    return flags


def _most_often_best(scenes: Sequence[Scene]) -> tuple[tuple[str, ...], int]:
    """The methods that are among the best on most scenes, and on how many."""
    times = Counter(e.label for s in scenes for e in s.entries if e.best)
    most = max(times.values(), default=0)
    return tuple(sorted(label for label, count in times.items() if count == most)), most


def _order_depends(what: str, found: Sequence[Reversal]) -> str:
    """The clearest pair that changes its order, at the top where there is one there, and how many there are."""
    clearest = max((r for r in found if r.at_the_top == found[0].at_the_top), key=_strength)
    a, b, c, d = map(degrees, clearest.medians)
    under, other = clearest.choices
    pairs = len({(r.scene, r.ahead, r.behind) for r in found})
    where = enumeration(list(dict.fromkeys(r.scene for r in found)))
    more = f" In all, {pairs} pairs of methods change places, on {where}." if pairs > 1 else ""
    return (
        f"The order of the methods depends on the {what}: on {clearest.scene}, {clearest.ahead} is ahead of "
        f"{clearest.behind} under {under} ({a}° against {b}°) and behind it under {other} ({c}° against {d}°).{more}"
    )


def enumeration(names: Sequence[str]) -> str:
    """``a, b and c``; a long list is cut: ``a, b, c, d and 3 more``."""
    names = list(names)
    if len(names) > NAMED + 1:
        names = [*names[:NAMED], f"{len(names) - NAMED} more"]
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def spoken(scene: Scene) -> str:
    """Name of a scene in prose."""
    return scene.instance.replace("_", " ")


def _known(scenes: Iterable[Scene]) -> list[Scene]:
    return [s for s in scenes if any(e.scored for e in s.entries)]


def _entries(scenes: Sequence[Scene], label: str) -> list[Entry]:
    """Its entries on the scenes on which every seed of it ended well."""
    found = (next((e for e in s.entries if e.label == label), None) for s in scenes)
    return [e for e in found if e is not None and e.ok == e.seeds and e.values["median_deg"].known]


def _near(own: Sequence[Entry], base: Sequence[Entry]) -> bool:
    pairs = zip(own, base, strict=True)
    return all(a.values["median_deg"].mean - b.values["median_deg"].mean <= NEAR_DEG for a, b in pairs)


def _ratio(slow: Sequence[Entry], fast: Sequence[Entry]) -> float:
    times = [(a.values["solve_s"].mean, b.values["solve_s"].mean) for a, b in zip(slow, fast, strict=True)]
    return geometric_mean(a / b if b > 0 else math.nan for a, b in times)


def _times(ratio: float) -> str:
    return f"{ratio:.0f} times" if ratio >= 10 else f"{ratio:.1f} times"


def _strength(reversal: Reversal) -> float:
    """How clear it is: the smaller of its two ratios."""
    return min(reversal.medians[1] / reversal.medians[0], reversal.medians[2] / reversal.medians[3])


def _last(value: float) -> float:
    return value if math.isfinite(value) else math.inf
