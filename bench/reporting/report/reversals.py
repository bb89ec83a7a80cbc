"""Whether the ranking depends on a choice: the alignment rule, or which cameras are scored. Pure functions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from bench.reporting.report.standing import ended_well
from bench.reporting.rows import Configured, Entry, Scene
from bench.scoring.statistics import FLOOR_DEG

MARGIN = 1.05  # medians closer than this ratio are not an order


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


def by_alignment(scenes_by_rule: Mapping[str, Sequence[Scene]]) -> list[Reversal]:
    """Reversals between the first rule and each of the others, those at the top first."""
    (first, base), *others = scenes_by_rule.items()
    found = []
    for rule, scenes in others:
        at = {(s.dataset, s.instance, s.protocol): s for s in scenes}
        for scene in base:
            found += reversals(scene, at[scene.dataset, scene.instance, scene.protocol], (first, rule))
    return _ordered(found)


def by_protocol(scenes: Sequence[Scene]) -> list[Reversal]:
    """Reversals on scenes that were run under more than one protocol."""
    found = []
    for left, right in combinations(scenes, 2):
        if (left.dataset, left.instance) == (right.dataset, right.instance):
            found += reversals(left, right, (left.protocol, right.protocol))
    return _ordered(found)


def reversals(left: Scene, right: Scene, choices: tuple[str, str]) -> list[Reversal]:
    """Every pair of methods that changes its order by more than `MARGIN` on both sides."""
    pairs = {_key(entry): [entry] for entry in left.entries if ended_well(entry)}
    for entry in right.entries:
        if _key(entry) in pairs and ended_well(entry):
            pairs[_key(entry)].append(entry)
    both = sorted((pair for pair in pairs.values() if len(pair) == 2), key=lambda pair: _median(pair[0]))
    found = []
    for ahead, behind in combinations(both, 2):
        medians = _median(ahead[0]), _median(behind[0]), _median(ahead[1]), _median(behind[1])
        if medians[1] > MARGIN * medians[0] and medians[2] > MARGIN * medians[3]:
            top = ahead[0].best and not behind[0].best and behind[1].best and not ahead[1].best
            found.append(
                Reversal(left.instance.replace("_", " "), choices, ahead[0].label, behind[0].label, medians, top)
            )
    return found


def _ordered(found: Sequence[Reversal]) -> list[Reversal]:
    return sorted(found, key=lambda r: not r.at_the_top)


def _key(entry: Entry) -> Configured:
    return entry.method, entry.params


def _median(entry: Entry) -> float:
    return max(entry.values["median_deg"].mean, FLOOR_DEG)
