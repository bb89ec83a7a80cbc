"""Which of two methods is clearly better: a fold turns the order round under another alignment, noise does not."""

import itertools

import numpy as np
import pytest

from bench.core import so3
from bench.core.problem import Floats
from bench.scoring.inference.dominance import clearly_better
from bench.scoring.metrics.alignment import RULES
from bench.scoring.metrics.errors import camera_errors

N = 200
Errors = dict[str, dict[str, list[Floats]]]


def noisy(rng: np.random.Generator, truth: Floats, degrees: float) -> Floats:
    turned: Floats = so3.exp(np.radians(degrees) * rng.standard_normal((len(truth), 3))) @ truth
    return turned


def by_rule(truth: Floats, estimates: dict[str, Floats]) -> Errors:
    return {rule: {name: [camera_errors(r, truth, rule)] for name, r in estimates.items()} for rule in RULES}


@pytest.fixture
def folded() -> Errors:
    """A precise estimate with a quarter turned by 25 degrees, a coarse one without, and a bad one."""
    rng = np.random.default_rng(0)
    truth = so3.random(rng, N)
    precise = noisy(rng, truth, 1.4)
    precise[: N // 4] = precise[: N // 4] @ so3.exp(np.radians(25) * np.array([0.6, 0, 0.8]))
    return by_rule(truth, {"precise": precise, "coarse": noisy(rng, truth, 3), "bad": noisy(rng, truth, 12)})


def test_a_fold_reverses_the_order_under_another_rule(folded: Errors) -> None:
    worse_than = {("precise", "bad"), ("coarse", "bad")}
    for rule in ("l1", "anchors"):
        assert clearly_better(folded[rule]) == worse_than | {("precise", "coarse")}
    for rule in ("chordal", "karcher"):
        assert clearly_better(folded[rule]) == worse_than | {("coarse", "precise")}


def test_methods_that_ran_once_stand_for_every_seed(folded: Errors) -> None:
    once = folded["l1"]
    repeated = {name: seeds * (1 if name == "coarse" else 3) for name, seeds in once.items()}
    assert clearly_better(repeated) == clearly_better(once)


def test_seeds_that_disagree_are_no_order() -> None:
    rng = np.random.default_rng(0)
    a, b = (rng.gamma(2, scale, N) for scale in (1, 3))
    assert clearly_better({"a": [a, a], "b": [b, b]}) == {("a", "b")}
    assert clearly_better({"a": [a, b], "b": [b, a]}) == set()


def test_what_is_not_scored_is_not_compared(folded: Errors) -> None:
    once = folded["l1"]
    once["precise"][0][: N // 4] = np.nan
    assert clearly_better(once) == {("coarse", "bad")}
    once["bad"][0][:-2] = np.nan
    assert clearly_better(once) == set()
    assert clearly_better({}) == clearly_better({"a": []}) == set()
    assert clearly_better({"a": [np.zeros(5)], "b": [np.ones(5)]}) == set()


def test_false_alarms_are_as_rare_as_promised_and_reversals_rarer() -> None:
    single, reversed_ones, trials = 0, 0, 60
    for seed in range(trials):
        rng = np.random.default_rng(seed)
        truth = so3.random(rng, N)
        twins = {name: noisy(rng, truth, 3) for name in "ab"}
        for rotations in twins.values():
            rotations[:10] = so3.random(rng, 10)
        better = {rule: clearly_better(errors) for rule, errors in by_rule(truth, twins).items()}
        single += bool(better["l1"])
        reversed_ones += any(
            {(a, b) for b, a in better[one]} & better[other] for one, other in itertools.combinations(RULES, 2)
        )
    assert single <= 0.1 * trials
    assert reversed_ones == 0
