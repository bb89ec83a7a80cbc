import numpy as np
import pytest

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Problem
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
