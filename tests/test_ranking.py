"""Comparisons over several problems: blocks, ranks, critical differences, profiles; by hand or against scipy."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from bench.scoring.inference.blocks import Blocks, blocks, by_scene
from bench.scoring.inference.profiles import performance_profiles
from bench.scoring.inference.ranking import critical_difference, friedman_p, mean_ranks, rank_probabilities, ranks

RNG = np.random.default_rng(0)


def table(values: object, scenes: tuple[int, ...] | None = None) -> Blocks:
    array = np.asarray(values, dtype=float)
    methods = tuple((name, "") for name in "abcdefgh"[: array.shape[1]])
    return Blocks(methods, array, scenes or tuple(range(len(array))))


def row(instance: str, method: str, median: float, **more: object) -> dict[str, object]:
    facts = {"dataset": "d", "instance": instance, "instance_key": instance, "protocol": "all", "seed": 0}
    facts |= {"method": method, "params": "", "outcome": "ok", "n_scored": 100, "median_deg": median}
    return facts | more


class TestBlocks:
    def test_a_method_that_is_not_installed_is_left_out_and_not_ranked_last(self) -> None:
        rows = [row(scene, method, 1.0) for scene in "pq" for method in "ab"]
        absent = {"outcome": "not-installed", "n_scored": 0}
        found = blocks(pd.DataFrame([*rows, *(row(scene, "c", np.nan, **absent) for scene in "pq")]))
        assert found.methods == (("a", ""), ("b", ""))

    def test_seeds_of_one_instance_are_one_block_and_other_instances_one_each(self) -> None:
        rows = [row("real", "a", median, seed=s) for s, median in enumerate((1.0, 4.0))]
        rows += [row("real", "b", 3.0)]
        rows += [row("drawn", m, 2.0, seed=s, instance_key=f"drawn{s}") for m in "ab" for s in range(3)]
        found = blocks(pd.DataFrame(rows))
        assert found.methods == (("a", ""), ("b", ""))
        assert np.allclose(found.values, [[2, 3], [2, 2], [2, 2], [2, 2]])
        assert found.scenes == (0, 1, 1, 1)

    def test_of_a_scene_under_two_protocols_the_first_counts(self) -> None:
        rows = [
            row("s", m, d, protocol=p, instance_key=p) for p, d in (("component", 2.0), ("other", 8.0)) for m in "ab"
        ]
        assert np.allclose(blocks(pd.DataFrame(rows)).values, [[2.0, 2.0]])

    def test_of_each_scene_only_its_own_methods_count(self) -> None:
        rows = [row("s", "a", 1.0), row("s", "b", 2.0), row("t", "a", 2.0), row("t", "c", 1.0)]
        found = by_scene(pd.DataFrame(rows))
        assert found["d", "s"].methods == (("a", ""), ("b", ""))
        assert mean_ranks(found["d", "t"]).tolist() == [2.0, 1.0]

    def test_failing_and_leaving_out_cameras_is_worse_than_any_error(self) -> None:
        rows = [
            row("s", "a", 9.0),
            row("s", "b", np.nan, outcome="timeout", n_scored=0),
            row("s", "c", 0.1, n_scored=90),
        ]
        rows += [row("t", m, np.nan, n_scored=0) for m in "abc"]
        found = blocks(pd.DataFrame(rows))
        assert found.values.tolist() == [[9.0, np.inf, np.inf]] or np.allclose(found.values[0, 0], 9.0)
        assert np.isinf(found.values[0, 1:]).all()
        assert not found.enough

    def test_a_method_that_was_not_run_everywhere_is_left_out(self) -> None:
        found = blocks(pd.DataFrame([row("s", "a", 1.0), row("s", "b", 1.0), row("t", "a", 2.0)]))
        assert (found.methods, found.left_out) == ((("a", ""),), (("b", ""),))

    def test_exact_recoveries_are_not_ranked_by_their_rounding(self) -> None:
        found = blocks(pd.DataFrame([row("s", "a", 1e-9), row("s", "b", 1e-13)]))
        assert found.values[0, 0] == found.values[0, 1]

    def test_nothing_scored(self) -> None:
        assert not blocks(pd.DataFrame([row("s", "a", np.nan, n_scored=0)])).enough


class TestRanks:
    def test_ties_share_the_mean_and_failures_come_last(self) -> None:
        assert ranks(np.array([[2.0, 1.0, 2.0, np.inf]])).tolist() == [[2.5, 1.0, 2.5, 4.0]]

    def test_probabilities_are_certain_where_one_always_wins_and_shared_where_two_tie(self) -> None:
        found = rank_probabilities(table([[1, 2, 2], [5, 7, 7]]))
        assert found.tolist() == [[1, 0, 0], [0, 0.5, 0.5], [0, 0.5, 0.5]]

    def test_probabilities_are_those_of_the_bootstrap(self) -> None:
        """One of three scenes goes to b: b leads a resample with two or three draws of it, 7 of 27."""
        found = rank_probabilities(table([[1, 2], [1, 2], [2, 1]]))
        assert found[1, 0] == pytest.approx(7 / 27, abs=0.03)
        assert np.allclose(found.sum(axis=0), 1)
        assert np.allclose(found.sum(axis=1), 1)

    def test_problems_of_a_scene_are_drawn_too(self) -> None:
        found = rank_probabilities(table([[1, 2], [1, 2], [2, 1]], (0, 0, 0)))
        assert found[1, 0] == pytest.approx(7 / 27, abs=0.03)

    def test_many_seeds_of_one_scene_do_not_outvote_the_others(self) -> None:
        values = [[2, 1]] * 9 + [[1, 2]] * 2
        problems = table(values, (0,) * 9 + (1, 2))
        assert mean_ranks(problems).tolist() == pytest.approx([4 / 3, 5 / 3])
        assert rank_probabilities(problems)[:, 0].tolist() == pytest.approx([20 / 27, 7 / 27], abs=0.03)
        found = critical_difference(problems)
        assert found.mean_ranks.tolist() == pytest.approx([4 / 3, 5 / 3])
        equal = critical_difference(table([[1, 2]] * 4))  # 81 / 19 problems of equal weight tell as much
        assert found.critical_difference == pytest.approx(equal.critical_difference * np.sqrt(4 * 19 / 81))


class TestCriticalDifference:
    def test_friedman_is_scipys_in_the_form_of_iman_and_davenport(self) -> None:
        values = RNG.random((12, 4)).round(1)
        chi = stats.friedmanchisquare(*values.T).statistic
        f = 11 * chi / (12 * 3 - chi)
        same = np.full(12, 1 / 12)
        assert friedman_p(ranks(values), same) == pytest.approx(stats.f.sf(f, 3, 33))
        assert friedman_p(ranks(np.tile([1.0, 2.0, 3.0], (5, 1))), np.full(5, 0.2)) == 0
        assert friedman_p(ranks(np.ones((5, 3))), np.full(5, 0.2)) == 1

    def test_nemenyis_difference_is_demsars(self) -> None:
        """q of Table 5(a) in Demsar 2006: 2.569 for four methods, 3.164 for ten; there CD = 1.25 for 14 data sets."""
        found = critical_difference(table(RNG.random((14, 4))))
        assert found.critical_difference == pytest.approx(2.569 * np.sqrt(4 * 5 / (6 * 14)), abs=1e-3)
        ten = critical_difference(
            Blocks(tuple((str(k), "") for k in range(10)), RNG.random((20, 10)), tuple(range(20)))
        )
        assert ten.critical_difference == pytest.approx(3.164 * np.sqrt(110 / 120), abs=1e-2)

    def test_groups_join_what_is_not_told_apart(self) -> None:
        base = RNG.random((20, 1)) + 1
        values = base * np.array([5.0, 1.0, 1.0, 5.0]) * np.exp(0.1 * RNG.standard_normal((20, 4)))
        found = critical_difference(table(values))
        assert found.friedman_p < 1e-6
        assert found.groups == ((0, 1), (2, 3))
        assert {found.methods[0][0], found.methods[1][0]} == {"b", "c"}
        apart = np.abs(np.subtract.outer(found.mean_ranks, found.mean_ranks))
        p_values = stats.studentized_range.sf(apart * np.sqrt(12 * 20 / (4 * 5)), 4, np.inf)
        assert np.array_equal(p_values < 0.05, apart > found.critical_difference)

    def test_groups_overlap_where_the_ends_are_told_apart_and_the_middle_from_neither(self) -> None:
        orders = [[1, 2, 3]] * 8 + [[2, 1, 3]] * 4 + [[1, 3, 2]] * 4 + [[2, 3, 1]] * 2 + [[3, 2, 1]] * 2
        found = critical_difference(table(orders))
        assert found.mean_ranks.tolist() == pytest.approx([1.5, 2.1, 2.4])
        assert found.groups == ((0, 1), (1, 2))

    def test_without_friedman_all_are_one_group(self) -> None:
        found = critical_difference(table([[1, 2, 3], [3, 2, 1], [2, 1, 3]]))
        assert found.groups == ((0, 2),)


class TestProfiles:
    def test_shares_are_those_worked_out_by_hand(self) -> None:
        a, b = performance_profiles(table([[1, 2], [3, 3], [4, 1], [1, np.inf]]))
        assert (a.ratios.tolist(), a.shares.tolist()) == ([1, 4], [0.75, 1])
        assert (b.ratios.tolist(), b.shares.tolist()) == ([1, 2], [0.5, 0.75])

    def test_one_that_never_wins_starts_at_zero(self) -> None:
        _, b = performance_profiles(table([[1, 2], [1, 3]]))
        assert (b.ratios.tolist(), b.shares.tolist()) == ([1, 2, 3], [0, 0.5, 1])
