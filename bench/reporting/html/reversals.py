"""Whether the ranking depends on a choice: the alignment rule, or which cameras are scored. Pure functions."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import combinations

from bench.reporting.tables.rows import Entry, Scene
from bench.reporting.tables.standing import ended_well
from bench.scoring.inference.resampling import FLOOR_DEG
from bench.scoring.results import Configured, Place

MARGIN = 1.05  # medians closer than this ratio are not an order
Better = Mapping[Place, Set[tuple[Configured, Configured]]]  # pairs of which the first is better beyond chance


@dataclass(frozen=True)
class Reversal:
    """Two methods whose medians on one scene are in one order under one choice and in the other under another.

    Parameters
    ----------
    scene
        Name of the instance.
    choices
        The two choices.
    ahead, behind
        Labels of the two methods, in their order under the first choice.
    medians
        Of `ahead` and `behind` under the first choice, then under the second, in degrees.
    at_the_top
        Whether it concerns who is best: under each choice the one in front is among the best and the other is not.
    """

    scene: str
    choices: tuple[str, str]
    ahead: str
    behind: str
    medians: tuple[float, float, float, float]
    at_the_top: bool


def by_alignment(scenes_by_rule: Mapping[str, Sequence[Scene]], better: Mapping[str, Better]) -> list[Reversal]:
    """Reversals between the first rule and each of the others, those at the top first."""
    (first, base), *others = scenes_by_rule.items()
    found = []
    for rule, scenes in others:
        at = {s.place: s for s in scenes}
        for scene in base:
            found += reversals(scene, at[scene.place], (first, rule), (better[first], better[rule]))
    return _ordered(found)


def by_protocol(scenes: Sequence[Scene], better: Better) -> list[Reversal]:
    """Reversals on scenes that were run under more than one protocol."""
    found = []
    for left, right in combinations(scenes, 2):
        if (left.dataset, left.instance) == (right.dataset, right.instance):
            found += reversals(left, right, (left.protocol, right.protocol), (better, better))
    return _ordered(found)


def reversals(left: Scene, right: Scene, choices: tuple[str, str], better: tuple[Better, Better]) -> list[Reversal]:
    """Every pair of methods that changes its order by more than `MARGIN`, and beyond chance, on both sides."""
    pairs = {entry.key: [entry] for entry in left.entries if ended_well(entry)}
    for entry in right.entries:
        if entry.key in pairs and ended_well(entry):
            pairs[entry.key].append(entry)
    both = sorted((pair for pair in pairs.values() if len(pair) == 2), key=lambda pair: _median(pair[0]))
    under, against = better[0].get(left.place, set()), better[1].get(right.place, set())
    found = []
    for ahead, behind in combinations(both, 2):
        a, b = ahead[0].key, behind[0].key
        medians = _median(ahead[0]), _median(behind[0]), _median(ahead[1]), _median(behind[1])
        clear = (a, b) in under and (b, a) in against
        if clear and medians[1] > MARGIN * medians[0] and medians[2] > MARGIN * medians[3]:
            top = ahead[0].best and not behind[0].best and behind[1].best and not ahead[1].best
            found.append(
                Reversal(left.instance.replace("_", " "), choices, ahead[0].label, behind[0].label, medians, top)
            )
    return found


def _ordered(found: Sequence[Reversal]) -> list[Reversal]:
    return sorted(found, key=lambda r: not r.at_the_top)


def _median(entry: Entry) -> float:
    return max(entry.values["median_deg"].mean, FLOOR_DEG)
