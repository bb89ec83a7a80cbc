"""Whether a ranking depends on the alignment: a fold turns it round, noise does not."""

import numpy as np
import pytest

from bench import so3
from bench.problem import Floats
from bench.scoring.alignment import RULES
from bench.scoring.errors import camera_errors
from bench.scoring.ranking import reversals

N = 200


def noisy(rng: np.random.Generator, truth: Floats, degrees: float) -> Floats:
    turned: Floats = so3.exp(np.radians(degrees) * rng.standard_normal((len(truth), 3))) @ truth
    return turned


def by_rule(truth: Floats, estimates: dict[str, Floats]) -> dict[str, dict[str, Floats]]:
    return {rule: {name: camera_errors(r, truth, rule) for name, r in estimates.items()} for rule in RULES}


@pytest.fixture
def folded() -> dict[str, dict[str, Floats]]:
    """A precise estimate with a quarter turned by 25 degrees, a coarse one without, and a bad one."""
    rng = np.random.default_rng(0)
    truth = so3.random(rng, N)
    precise = noisy(rng, truth, 1.4)
    precise[: N // 4] = precise[: N // 4] @ so3.exp(np.radians(25) * np.array([0.6, 0, 0.8]))
    return by_rule(truth, {"precise": precise, "coarse": noisy(rng, truth, 3), "bad": noisy(rng, truth, 12)})


def test_a_fold_reverses_the_order_under_another_rule(folded: dict[str, dict[str, Floats]]) -> None:
    (found,) = reversals(folded)
    assert (found.first, found.second, found.under) == ("precise", "coarse", "l1")
    assert found.against in {"chordal", "karcher"}
    assert found.first_deg == pytest.approx((2.9, 7.1), abs=0.4)
    assert found.second_deg == pytest.approx((4.6, 4.6), abs=0.4)


def test_one_rule_or_rules_that_agree_reverse_nothing(folded: dict[str, dict[str, Floats]]) -> None:
    assert reversals({"l1": folded["l1"]}) == []
    assert reversals({"l1": folded["l1"], "anchors": folded["anchors"]}) == []
    assert reversals({}) == []


def test_the_statistic_and_the_seeds_count(folded: dict[str, dict[str, Floats]]) -> None:
    assert reversals(folded, "mean") == []
    seeds = {rule: {m: e if m == "coarse" else np.stack([e, e]) for m, e in by.items()} for rule, by in folded.items()}
    assert [(r.first, r.second) for r in reversals(seeds)] == [("precise", "coarse")]


def test_what_was_not_scored_is_not_compared(folded: dict[str, dict[str, Floats]]) -> None:
    folded["karcher"]["bad"][:] = np.nan
    assert len(reversals(folded)) == 1
    for errors in folded.values():
        errors["coarse"][N // 4 :] = np.nan  # only the folded cameras are left, on which it is always better
    assert reversals(folded) == []


def test_methods_of_the_same_quality_are_never_reversed() -> None:
    alarms = 0
    for seed in range(25):
        rng = np.random.default_rng(seed)
        truth = so3.random(rng, N)
        twins = {name: noisy(rng, truth, 3) for name in ("a", "b", "c")}
        for rotations in twins.values():
            rotations[:10] = so3.random(rng, 10)
        alarms += bool(reversals(by_rule(truth, twins)))
    assert alarms == 0
