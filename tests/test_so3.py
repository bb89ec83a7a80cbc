"""Properties of the SO(3) maths, and twins in scipy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from bench.core import so3

vectors = arrays(float, (4, 3), elements=st.floats(-10, 10))
EXTREMES = np.array([[0, 0, 0], [1e-300, 0, 0], [1e-9, 0, 0], [np.pi, 0, 0], [0, np.pi - 1e-9, 0], [0, 0, 3.0]])


@given(vectors)
def test_exp_and_log_agree_with_scipy(v: np.ndarray) -> None:
    twin = Rotation.from_rotvec(v)
    np.testing.assert_allclose(so3.exp(v), twin.as_matrix(), atol=1e-13)
    r = twin.as_matrix()
    np.testing.assert_allclose(so3.exp(so3.log(r)), r, atol=1e-13)
    assert (np.linalg.norm(so3.log(r), axis=-1) <= np.pi + 1e-12).all()


@pytest.mark.parametrize("v", EXTREMES)
def test_log_inverts_exp_at_the_ends(v: np.ndarray) -> None:
    back = so3.log(so3.exp(v))
    np.testing.assert_allclose(so3.exp(back), so3.exp(v), atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(back), np.linalg.norm(v), atol=1e-15, rtol=1e-12)


@pytest.mark.parametrize("angle", [1e-15, 1e-9, 1e-3, 1.0, np.pi - 1e-9, np.pi])
def test_angle_is_exact_where_the_arccos_of_the_trace_is_blind(angle: float) -> None:
    axis = so3.random_axes(np.random.default_rng(0), 50)
    np.testing.assert_allclose(so3.angle(so3.exp(angle * axis)), angle, rtol=1e-12, atol=1e-15)


@given(arrays(float, (3, 3), elements=st.floats(-1e3, 1e3)))
def test_project_gives_a_rotation_that_no_other_beats(m: np.ndarray) -> None:
    r = so3.project(m)
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(r) > 0
    others = so3.random(np.random.default_rng(0), 20)
    assert (np.linalg.norm(m - r) <= np.linalg.norm(m - others, axis=(1, 2)) + 1e-9).all()


def test_quaternions_round_trip_and_follow_scipy() -> None:
    r = so3.random(np.random.default_rng(0), 200)
    q = so3.to_quaternion(r)
    np.testing.assert_allclose(so3.from_quaternion(q), r, atol=1e-14)
    twin = Rotation.from_matrix(r).as_quat(canonical=True, scalar_first=True)
    np.testing.assert_allclose(np.abs(np.sum(q * twin, axis=-1)), 1, atol=1e-14)


def test_hat_is_the_cross_product_and_vee_its_inverse() -> None:
    v, x = np.random.default_rng(0).standard_normal((2, 5, 3))
    np.testing.assert_allclose((so3.hat(v) @ x[..., None])[..., 0], np.cross(v, x))
    np.testing.assert_allclose(so3.vee(so3.hat(v)), v)


def test_euler_angles_follow_scipy() -> None:
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, (20, 3))
    np.testing.assert_allclose(so3.from_euler(angles), Rotation.from_euler("xyz", angles).as_matrix(), atol=1e-14)


def test_random_rotations_are_haar() -> None:
    """Every entry has mean 0 and mean square 1/3; the angle's density is (1 - cos) / pi."""
    r = so3.random(np.random.default_rng(0), 40_000)
    np.testing.assert_allclose(r.mean(axis=0), 0, atol=0.02)
    np.testing.assert_allclose((r**2).mean(axis=0), 1 / 3, atol=0.01)
    angles = np.sort(so3.angle(r))
    expected = (angles - np.sin(angles)) / np.pi
    assert np.abs(expected - np.linspace(0, 1, len(angles))).max() < 0.01


@pytest.mark.parametrize("mean", [so3.chordal_mean, so3.karcher_mean, so3.geodesic_median])
def test_means_follow_the_world_and_find_a_common_rotation(mean: object) -> None:
    rng = np.random.default_rng(0)
    center, turn = so3.random(rng, 2)
    r = so3.exp(0.1 * rng.standard_normal((30, 3))) @ center
    found = mean(r)  # type: ignore[operator]
    assert so3.angle_between(found, center) < 0.1
    np.testing.assert_allclose(mean(turn @ r), turn @ found, atol=1e-8)  # type: ignore[operator]
    np.testing.assert_allclose(mean(np.tile(center, (5, 1, 1))), center, atol=1e-12)  # type: ignore[operator]


@pytest.mark.parametrize("spread", [0.3, 1.0])
def test_karcher_mean_follows_scipy(spread: float) -> None:
    r = so3.exp(spread * np.random.default_rng(0).standard_normal((30, 3)))
    step = so3.log(r @ so3.karcher_mean(r).T).mean(axis=0)
    assert np.linalg.norm(step) < 1e-11
    np.testing.assert_allclose(so3.chordal_mean(r), Rotation.from_matrix(r).mean().as_matrix(), atol=1e-12)


def test_geodesic_median_ignores_a_minority_of_outliers() -> None:
    rng = np.random.default_rng(0)
    center = so3.random(rng, 1)[0]
    r = np.concatenate([np.tile(center, (60, 1, 1)), so3.random(rng, 40)])
    assert so3.angle_between(so3.geodesic_median(r), center) < 1e-6
    assert so3.angle_between(so3.chordal_mean(r), center) > 1e-2
