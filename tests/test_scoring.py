import numpy as np
import pytest
from scipy import stats

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Problem
from bench.scoring.inference.resampling import camera_variance, combined, replicates, seed_variance
from bench.scoring.inference.seed_ties import tied_by_seed
from bench.scoring.inference.statistics import confidence_interval, seed_half_width, tie_groups, tied
from bench.scoring.metrics.alignment import RULES, align
from bench.scoring.metrics.errors import AUC_DEG, camera_errors, edge_metrics, summary


@pytest.fixture
def rng():
    return np.random.default_rng(0)


every_rule = pytest.mark.parametrize("rule", RULES)


def noise(rng, size, degrees):
    return so3.exp(np.radians(degrees) * rng.standard_normal((size, 3)))


def transpose(r):
    return np.swapaxes(r, -1, -2)


def cost(center, r):
    return so3.angle_between(r, center).sum()


def folded_scene(rng, n=300):
    """Truth, and an estimate of which a quarter is turned by 25 degrees as one piece."""
    truth = so3.random(rng, n)
    fold = np.tile(np.eye(3), (n, 1, 1))
    fold[: n // 4] = so3.exp(np.radians(25) * so3.random_axes(rng, 1))
    return truth, noise(rng, n, 1.4) @ truth @ fold


class TestGeodesicMedian:
    def test_is_a_member_that_outweighs_the_rest(self, rng):
        center = so3.random(rng, 1)[0]
        r = np.concatenate([np.repeat(center[None], 7, axis=0), so3.random(rng, 5)])
        assert np.degrees(so3.angle_between(so3.geodesic_median(r), center)) < 1e-9

    def test_identical_members(self):
        assert np.array_equal(so3.geodesic_median(np.tile(np.eye(3), (4, 1, 1))), np.eye(3))

    @pytest.mark.parametrize("size", [1, 2, 3, 4])
    def test_no_member_is_cheaper(self, rng, size):
        for _ in range(20):
            r = so3.random(rng, size)
            median = so3.geodesic_median(r)
            assert cost(median, r) <= min(cost(member, r) for member in r) + 1e-9

    def test_finds_the_tenth_that_agrees_among_random_rotations(self, rng):
        center = so3.random(rng, 1)[0]
        r = np.concatenate([so3.random(rng, 180), noise(rng, 20, 1) @ center])
        assert np.degrees(so3.angle_between(so3.geodesic_median(rng.permutation(r)), center)) < 3

    def test_no_step_goes_down(self, rng):
        r = np.concatenate([so3.random(rng, 30), noise(rng, 70, 10)])
        median = so3.geodesic_median(r)
        steps = so3.exp(1e-4 * so3.random_axes(rng, 50))
        assert all(cost(step @ median, r) >= cost(median, r) for step in steps)


class TestAlignment:
    @every_rule
    def test_recovers_a_known_gauge(self, rng, rule):
        truth, gauge = so3.random(rng, 40), so3.random(rng, 1)[0]
        found = align(truth @ gauge.T, truth, rule)
        assert np.degrees(so3.angle_between(found, gauge)) < 1e-10

    def test_rules_agree_where_the_errors_are_small(self, rng):
        truth = so3.random(rng, 200)
        estimate = noise(rng, 200, 0.2) @ truth
        medians = [summary(camera_errors(estimate, truth, rule))["median_deg"] for rule in RULES]
        assert np.ptp(medians) < 0.02

    def test_rules_part_on_a_folded_scene(self, rng):
        truth, estimate = folded_scene(rng)
        median = {rule: summary(camera_errors(estimate, truth, rule))["median_deg"] for rule in RULES}
        assert median["l1"] == pytest.approx(2.9, abs=0.2)
        assert median["anchors"] == pytest.approx(2.9, abs=0.2)
        assert median["chordal"] == pytest.approx(7.1, abs=0.2)
        assert median["karcher"] == pytest.approx(7.2, abs=0.2)

    @every_rule
    def test_turning_either_world_changes_no_error(self, rng, rule):
        truth, estimate = folded_scene(rng, 60)
        w, v = so3.random(rng, 2)
        expected = camera_errors(estimate, truth, rule)
        assert np.allclose(camera_errors(estimate @ w, truth @ v, rule), expected, rtol=0, atol=1e-6)

    @every_rule
    def test_is_deterministic(self, rng, rule):
        truth, estimate = folded_scene(rng, 60)
        assert np.array_equal(align(estimate, truth, rule), align(estimate, truth, rule))

    @every_rule
    def test_one_camera_is_aligned_exactly(self, rng, rule):
        truth, estimate = so3.random(rng, 1), so3.random(rng, 1)
        assert camera_errors(estimate, truth, rule)[0] < 1e-12

    def test_anchors_keep_the_best_of_all_cameras(self):
        """Each camera's frame has a median of its own; of 30 noisy ones the worst is half a degree worse."""
        rng = np.random.default_rng(7)
        truth = so3.random(rng, 30)
        estimate = noise(rng, 30, 40) @ truth
        means = []
        for own, known in zip(estimate, truth, strict=True):
            centre = np.eye(3)
            for _ in range(20):
                left = own @ transpose(estimate) @ truth @ known.T @ centre.T
                centre = so3.exp(np.median(so3.log(left), axis=0)) @ centre
            means.append(np.degrees(so3.angle_between(estimate @ own.T @ centre @ known, truth)).mean())
        assert max(means) > min(means) + 0.5
        assert min(means) < means[0] - 0.1
        assert camera_errors(estimate, truth, "anchors").mean() == pytest.approx(min(means), abs=1e-3)

    def test_anchors_stop_where_the_median_in_the_frame_of_one_is_zero(self, rng):
        truth, estimate = folded_scene(rng, 30)
        gauge = align(estimate, truth, "anchors")
        left = [own @ transpose(estimate) @ truth @ gauge.T @ own.T for own in estimate]
        assert min(np.linalg.norm(np.median(so3.log(each), axis=0)) for each in left) < 1e-5

    def test_an_unknown_rule_names_the_nearest(self):
        with pytest.raises(InputError, match="did you mean 'chordal'"):
            align(np.eye(3)[None], np.eye(3)[None], "cordal")


class TestCameraErrors:
    @pytest.mark.parametrize("degrees", [1e-9, 1e-6, 1, 90, 179.999999])
    def test_angles_are_exact_from_a_billionth_of_a_degree_on(self, rng, degrees):
        truth = so3.random(rng, 9)
        estimate = truth.copy()
        estimate[4] = so3.exp(np.radians(degrees) * so3.random_axes(rng, 1)[0]) @ truth[4]
        errors = camera_errors(estimate, truth)
        assert errors[4] == pytest.approx(degrees, abs=1e-13, rel=1e-9)
        assert np.delete(errors, 4).max() < 1e-13

    @every_rule
    def test_missing_cameras_are_nan_and_take_no_part(self, rng, rule):
        truth, estimate = folded_scene(rng, 50)
        expected = camera_errors(estimate[6:], truth[6:], rule)
        estimate[:3], truth[3:6] = np.nan, np.nan
        errors = camera_errors(estimate, truth, rule)
        assert np.isnan(errors[:6]).all()
        assert np.allclose(errors[6:], expected)

    def test_nothing_in_common(self):
        truth = np.full((3, 3, 3), np.nan)
        assert np.isnan(camera_errors(np.tile(np.eye(3), (3, 1, 1)), truth)).all()


class TestSummary:
    def test_values(self):
        found = summary(np.array([0.5, 2, np.nan, 4, 9.5]))
        assert found["mean_deg"] == 4
        assert found["median_deg"] == 3
        assert found["rms_deg"] == pytest.approx(np.sqrt((0.25 + 4 + 16 + 90.25) / 4))
        assert found["max_deg"] == 9.5
        assert found["p90_deg"] == pytest.approx(7.85)
        assert [found[f"within_{k}_deg"] for k in (1, 3, 5, 10, 30)] == [0.25, 0.5, 0.75, 1, 1]
        assert found["n_scored"] == 4

    def test_a_share_under_an_angle_does_not_hold_the_angle(self):
        assert summary(np.array([4.9, 5.0]))["within_5_deg"] == 0.5

    def test_the_area_under_the_recall_curve_is_exact(self):
        """By hand, and against the integral of the step function over a fine grid."""
        assert summary(np.array([0.0, 2.5, 10, 170, np.nan]))["auc_5_deg"] == pytest.approx((1 + 0.5) / 4)
        errors = np.random.default_rng(0).gamma(1, 4, 30)
        for limit in AUC_DEG:
            middles = (np.arange(100_000) + 0.5) * limit / 100_000
            recall = (errors[:, None] < middles).mean(axis=0)
            assert summary(errors)[f"auc_{limit}_deg"] == pytest.approx(recall.mean(), abs=1e-5)

    def test_nothing_scored_has_the_same_keys(self):
        found = summary(np.full(3, np.nan))
        assert found.keys() == summary(np.ones(3)).keys()
        assert found["n_scored"] == 0
        assert np.isnan(found["within_5_deg"])


class TestEdgeMetrics:
    @pytest.fixture
    def triangle(self, rng):
        """Three cameras; the last measurement is 30 degrees off."""
        truth = so3.random(rng, 3)
        edges = np.array([[0, 1], [0, 2], [1, 2]])
        measured = truth[edges[:, 0]] @ transpose(truth[edges[:, 1]])
        measured[2] = measured[2] @ so3.exp(np.radians([0, 0, 30]))
        return Problem(3, edges, measured), truth

    def test_costs_at_the_truth(self, triangle):
        problem, truth = triangle
        found = edge_metrics(problem, truth, truth)
        assert found["residual_mean_deg"] == pytest.approx(10)
        assert found["residual_median_deg"] == pytest.approx(0, abs=1e-9)
        assert found["cost_l1"] == found["cost_l1_truth"] == pytest.approx(np.radians(10))
        chord = np.linalg.norm(np.eye(3) - so3.exp(np.radians([0, 0, 30]))) ** 2
        assert found["cost_l2"] == found["cost_l2_truth"] == pytest.approx(chord / 3)

    def test_costs_compare_the_same_edges(self, triangle):
        problem, truth = triangle
        partly = truth.copy()
        partly[0] = np.nan
        found = edge_metrics(problem, truth, partly)
        assert found["residual_mean_deg"] == pytest.approx(10)
        assert found["cost_l1"] == found["cost_l1_truth"] == pytest.approx(np.radians(30))

    def test_without_truth(self, triangle):
        problem, truth = triangle
        found = edge_metrics(problem, truth)
        assert found["cost_l1"] == pytest.approx(np.radians(10))
        assert np.isnan(found["cost_l1_truth"])

    def test_no_edge_solved(self, triangle):
        problem, truth = triangle
        assert all(np.isnan(v) for v in edge_metrics(problem, np.full_like(truth, np.nan), truth).values())


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
