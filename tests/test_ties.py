"""Who ties with whom, and with what certainty: of cameras, and of seeds."""

import numpy as np
import pytest
from scipy import stats

from bench.scoring.inference.resampling import camera_variance, combined, replicates, seed_variance
from bench.scoring.inference.seed_ties import tied_by_seed
from bench.scoring.inference.statistics import confidence_interval, seed_half_width, tie_groups, tied


@pytest.fixture
def rng():
    return np.random.default_rng(0)


class TestTies:
    def test_tells_a_worse_method_from_two_good_ones(self, rng):
        scene = rng.gamma(2, 1, 200)
        jitter = np.exp(0.2 * rng.standard_normal((3, 200)))
        errors = {"a": scene * jitter[0], "b": scene * jitter[1], "worse": 1.6 * scene * jitter[2]}
        assert tie_groups(errors) == {"a", "b"}
        assert tie_groups(errors, ["mean"]) == {"a", "b"}
        assert tie_groups(errors) == tie_groups(errors)

    def test_pairing_sees_a_small_constant_difference(self, rng):
        scene = rng.gamma(2, 1, 100)
        assert tie_groups({"a": scene, "b": scene + 0.05}) == {"a"}

    def test_exact_recoveries_tie(self):
        assert tie_groups({"a": np.full(30, 1e-14), "b": np.full(30, 1e-8)}) == {"a", "b"}

    def test_leaving_out_the_hard_cameras_does_not_win(self, rng):
        scene = rng.gamma(2, 1, 100)
        easy = np.where(scene < np.median(scene), 0.9 * scene, np.nan)
        assert tie_groups({"all": scene, "easy": easy}) == {"all"}

    def test_a_few_missing_cameras_are_compared_without(self, rng):
        scene = rng.gamma(2, 1, 100)
        nearly = scene + 1
        nearly[:3] = np.nan
        assert tie_groups({"all": scene, "nearly": nearly}) == {"all"}

    def test_a_twentieth_may_be_missing_and_no_more(self, rng):
        scene = rng.gamma(2, 1, 100)
        better = 0.5 * scene
        better[:4] = np.nan
        assert tie_groups({"all": scene, "better": better}) == {"better"}
        better[:6] = np.nan
        assert tie_groups({"all": scene, "better": better}) == {"all"}

    def test_too_few_cameras_tie(self):
        assert tie_groups({"a": np.ones(5), "b": np.full(5, 9.0)}) == {"a", "b"}

    def test_nothing_scored(self):
        assert tie_groups({}) == set()
        assert tie_groups({"a": np.full((2, 20), np.nan)}) == set()

    def test_seeds_where_one_failed_for_everybody(self, rng):
        a = rng.gamma(2, 1, (4, 50))
        a[1] = np.nan
        assert tie_groups({"a": a, "b": 2 * a}) == {"a"}
        assert tie_groups({"a": a, "b": 2 * a}, same_cameras=False) == {"a"}

    def test_luck_of_the_seed_is_not_a_difference(self):
        """Methods that differ only by a factor drawn anew for each seed."""
        alarms = 0
        for trial in range(100):
            rng = np.random.default_rng(trial)
            luck = np.exp(0.3 * rng.standard_normal((6, 2, 1)))
            errors = luck * rng.gamma(2, 1, (1, 2, 40))
            alarms += len(tie_groups(dict(enumerate(errors)), same_cameras=False)) < 6
        assert alarms <= 9  # five are expected, give or take two

    def test_three_seeds_suffice_for_a_gross_difference(self, rng):
        scene = rng.gamma(2, 1, (3, 40))
        luck = np.exp(0.2 * rng.standard_normal((4, 3, 1)))
        errors = scene * luck * np.array([1, 1, 8, 9]).reshape(4, 1, 1)
        assert tie_groups(dict(enumerate(errors)), same_cameras=False) == {0, 1}

    def test_a_method_that_loses_a_third_of_the_cameras_does_not_tie_by_its_median(self):
        rng = np.random.default_rng(0)
        errors = rng.gamma(2, 1, (2, 60))
        errors[1, :20] = 100
        assert tie_groups({"whole": errors[0], "folded": errors[1]}) == {"whole"}

    @pytest.mark.parametrize("statistics", [["mean"], ["median"], ["median", "mean"]])
    def test_false_alarms_are_near_the_level(self, statistics):
        trials, methods = 80, 6
        alarms = 0
        for trial in range(trials):
            rng = np.random.default_rng(trial)
            errors = rng.gamma(2, 1, 60) * np.exp(0.3 * rng.standard_normal((methods, 60)))
            alarms += len(tie_groups(dict(enumerate(errors)), statistics)) < methods
        assert alarms / trials <= (0.1 if statistics == ["median"] else 0.2)


class TestVariances:
    @pytest.mark.parametrize("cameras", [2, 3, 5])
    def test_the_cameras_part_of_a_mean_is_that_of_a_t_test(self, rng, cameras):
        """Of so few cameras a bootstrap alone would say half, two thirds and four fifths as much."""
        table = rng.random((2, 1, cameras))
        draws = replicates(table, np.mean, True)
        found, freedom = camera_variance(table[0], draws[:, 0] - draws[:, 1], 0.0, True)
        difference = table[0, 0] - table[1, 0]
        assert found == pytest.approx(difference.var(ddof=1) / cameras, rel=0.15)
        assert freedom == cameras - 1

    def test_what_the_seeds_explain_is_not_laid_on_the_cameras_too(self, rng):
        by_seed = rng.random((2, 4, 1))
        table = np.tile(by_seed, (1, 1, 20))
        draws = replicates(table, np.mean, True)
        (of_seeds,), _ = seed_variance(by_seed[:1, :, 0] - by_seed[1:, :, 0])
        assert camera_variance(table[0], draws[:, 0] - draws[:, 1], of_seeds, True)[0] == 0

    def test_seeds_with_an_instance_each_hold_the_cameras_part(self, rng):
        assert camera_variance(rng.random((3, 20)), rng.random(1000), 0.0, False)[0] == 0

    def test_of_one_method_the_seeds_are_a_t_test(self, rng):
        sample = rng.random((1, 7))
        (variance,), freedom = seed_variance(sample)
        assert (variance, freedom) == (pytest.approx(sample.var(ddof=1) / 7), 6)

    def test_methods_lend_each_other_at_most_three_seeds(self, rng):
        assert seed_variance(rng.random((2, 2)))[1] == 1.5
        (small, _, large), freedom = seed_variance(np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 9.0]]))
        assert freedom == 2
        assert 0 < small < large < 81 / 4
        assert seed_variance(rng.random((50, 4)))[1] == 6

    def test_degrees_of_freedom_are_welchs(self, rng):
        a, b = rng.normal(0, 1, 5), rng.normal(0, 3, 9)
        total, freedom = combined(a.var(ddof=1) / 5, 4, b.var(ddof=1) / 9, 8)
        welch = stats.ttest_ind(a, b, equal_var=False)
        assert freedom == pytest.approx(welch.df)
        assert (a.mean() - b.mean()) / np.sqrt(total) == pytest.approx(welch.statistic)


class TestIntervals:
    def test_covers_about_as_often_as_it_says(self):
        hits = 0
        for trial in range(100):
            low, high = confidence_interval(np.random.default_rng(trial).exponential(1, 80))
            hits += low <= np.log(2) <= high
        assert hits >= 88

    def test_of_a_mean_is_the_normal_one(self, rng):
        errors = rng.exponential(1, 400)
        half = 1.96 * errors.std() / 20
        found = confidence_interval(errors, "mean")
        assert found == pytest.approx((errors.mean() - half, errors.mean() + half), abs=0.1 * half)

    def test_cameras_shared_by_the_seeds_are_not_counted_twice(self, rng):
        errors = np.tile(rng.exponential(1, 60), (1, 5, 1))
        spread = {same: replicates(errors, np.median, same).std() for same in (True, False)}
        assert spread[True] > 1.5 * spread[False]

    def test_nothing_scored(self):
        assert np.isnan(confidence_interval(np.full(9, np.nan))).all()

    def test_half_width_over_seeds(self):
        assert seed_half_width([1, 2, 3]) == pytest.approx(4.302653 / np.sqrt(3))
        assert np.isnan(seed_half_width([1, np.nan]))


def test_a_method_that_ran_once_ties_with_one_that_ran_under_every_seed() -> None:
    """On one instance a deterministic method has one seed, and must not drop out of the comparison for that."""
    errors = np.random.default_rng(0).uniform(1, 2, 60)
    once, often, worse = ("once", ""), ("often", ""), ("worse", "")
    by_method = {once: [errors], often: [errors * 1.001, errors, errors * 0.999], worse: [errors * 2]}
    assert tied(by_method, same_cameras=True) == {once, often}


def test_with_many_seeds_the_seeds_alone_tell_who_ties(rng):
    """Twins tie, five per cent more does not, and a method that skips the hard seeds does not compete."""
    hard = rng.lognormal(0, 1, 500)

    def rows(factor, spread=0.2):
        medians = factor * hard * rng.lognormal(0, spread, 500)
        return np.stack([np.arange(500), medians, 1.5 * medians, np.full(500, 20)], axis=1)

    easy = rows(0.5)
    easy[hard > np.quantile(hard, 0.9), 1:] = np.nan, np.nan, 0
    found = tied_by_seed({"one": rows(1.0), "twin": rows(1.0), "worse": rows(1.05), "easy": easy})
    assert found == {"one", "twin"}


def test_with_many_seeds_the_mean_tells_what_the_median_hides(rng):
    medians = rng.lognormal(0, 0.2, 300)
    whole, torn = (np.stack([np.arange(300), medians, k * medians, np.full(300, 20)], axis=1) for k in (1, 2))
    assert tied_by_seed({"whole": whole, "torn": torn}) == {"whole"}


def test_with_many_seeds_false_alarms_are_rare(rng):
    alarms = 0
    for _ in range(100):
        draws = np.exp(rng.normal(size=(4, 300)))
        rows = {k: np.stack([np.arange(300), d, d, np.ones(300)], axis=1) for k, d in enumerate(draws)}
        alarms += len(tied_by_seed(rows)) < 4
    assert alarms <= 10
