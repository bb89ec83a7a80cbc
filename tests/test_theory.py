"""The Cramér-Rao bound: closed forms, and methods that reach it."""

import numpy as np
import pytest
from graphs import grid_edges, random_edges, simulated
from scenes import load

from bench.core.errors import InputError
from bench.core.problem import Problem
from bench.datasets._simulated import noise
from bench.datasets.erdos_renyi import ErdosRenyi
from bench.methods.l1_irls import L1IRLS
from bench.methods.spectral import Spectral
from bench.scoring.metrics.errors import camera_errors
from bench.scoring.metrics.theory import (
    NOISES,
    cramer_rao_rms_deg,
    cramer_rao_variances,
    efficient_median_deg,
    information,
)


def bound(problem: Problem, noise: str = "tangent", noise_deg: float = 1.0) -> float:
    return cramer_rao_rms_deg(problem, np.ones(problem.m, dtype=bool), noise, noise_deg)


def complete(n: int) -> Problem:
    return simulated(random_edges(n, 1.0))[0]


# --- information -------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", NOISES)
def test_small_noise_tells_one_over_its_variance(noise: str) -> None:
    assert information(noise, 0.1) * np.radians(0.1) ** 2 == pytest.approx(1, rel=1e-5)
    assert information(noise, 0) == np.inf


def test_information_of_tangent_noise_to_second_order() -> None:
    """Its score is -angle (1 / sigma^2 - 1 / 6) up to the cube of the angle."""
    sigma = np.radians(5)
    assert information("tangent", 5) * sigma**2 == pytest.approx((1 - sigma**2 / 6) ** 2, rel=2e-5)


@pytest.mark.parametrize("noise_deg", [10, 40, 100])
def test_information_of_langevin_noise_agrees_with_its_samples(noise_deg: float) -> None:
    """It is -E[Laplacian of log f] / 3 too, and the trace is an eigenfunction: Laplacian of trace = -2 trace."""
    kappa = 0.5 / np.radians(noise_deg) ** 2
    samples = noise.sample("langevin", noise_deg, np.random.default_rng(0), 200_000)
    trace = np.trace(samples, axis1=1, axis2=2).mean()
    assert information("langevin", noise_deg) == pytest.approx(2 * kappa * trace / 3, rel=0.02)


# --- the bound on simple graphs ----------------------------------------------------------------------


def test_two_cameras_share_the_error_of_their_edge() -> None:
    assert bound(complete(2)) == pytest.approx(np.sqrt(3) / 2, rel=1e-3)


@pytest.mark.parametrize("n", [3, 10, 50])
def test_complete_graphs(n: int) -> None:
    """The pseudo-inverse of n I - 1 has the diagonal (n - 1) / n^2."""
    assert bound(complete(n)) == pytest.approx(np.sqrt(3 * (n - 1)) / n, rel=1e-3)


def test_the_middle_of_a_grid_is_known_best() -> None:
    problem, _ = simulated(grid_edges(7, 7))
    variances = cramer_rao_variances(problem, np.ones(problem.m, dtype=bool), "langevin", 2.0).reshape(7, 7)
    assert variances.argmin() == 24
    assert variances.argmax() in (0, 6, 42, 48)


def test_only_inliers_count() -> None:
    problem, _ = simulated(random_edges(12, 0.6))
    inliers = np.random.default_rng(0).random(problem.m) < 0.8
    alone = Problem(12, problem.edges[inliers], problem.rotations[inliers])
    assert cramer_rao_rms_deg(problem, inliers, "tangent", 5) == pytest.approx(bound(alone, noise_deg=5))
    assert bound(problem, noise_deg=5) < bound(alone, noise_deg=5)


def test_no_bound_where_inliers_do_not_connect_the_cameras() -> None:
    inliers = np.array([True, False])
    problem, _ = simulated(np.array([[0, 1], [1, 2]]))
    assert np.isnan(cramer_rao_variances(problem, inliers, "tangent", 5)).all()
    assert np.isnan(efficient_median_deg(problem, inliers, "tangent", 5))


def test_curvature_keeps_the_bound_below_the_error_of_a_guess() -> None:
    """A uniform rotation is 1 / 3 pi^2 + 2 rad^2 from the truth in the mean; flat space would soon say more."""
    pair = complete(2)
    everywhere = np.arange(1.0, 181.0)
    variances = [cramer_rao_variances(pair, np.ones(1, dtype=bool), "langevin", deg)[0] for deg in everywhere]
    assert 0 <= min(variances) <= max(variances) < np.pi**2 / 3 + 2
    assert 0.75 / information("langevin", 180) > 10
    flat = 0.75 / information("langevin", 60)
    assert variances[59] == pytest.approx(flat * (1 - flat / 9))


def test_no_noise_no_error() -> None:
    assert bound(complete(4), noise_deg=0) == 0


@pytest.mark.parametrize(
    ("noise", "noise_deg", "message"),
    [
        ("paper", 5.0, "singular at the identity"),
        ("langevn", 5.0, "did you mean 'langevin'"),
        ("tangent", 31.0, "from 0 to 30"),
        ("langevin", -1.0, "from 0 to 180"),
        ("langevin", float("nan"), "from 0 to 180"),
    ],
)
def test_what_has_no_bound_is_refused(noise: str, noise_deg: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        bound(complete(3), noise, noise_deg)


# --- methods reach it, and none beats it -------------------------------------------------------------


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("noise_deg", [1.0, 10.0])
def test_least_squares_reaches_the_bound(noise: noise.Noise, noise_deg: float) -> None:
    """Ratios of root mean squares over 50 draws have a standard error of about 1 %."""
    methods = {"l2": L1IRLS(loss="l2"), "spectral": Spectral(), "l1": L1IRLS(loss="l1")}
    squares = dict.fromkeys([*methods, "bound"], 0.0)
    mean, mean_l1, efficient = 0.0, 0.0, 0.0
    for seed in range(50):
        instance = load(ErdosRenyi(n=30, noise_deg=noise_deg, outliers=0.0, noise=noise), seed=seed)
        assert instance.truth is not None
        inliers = np.ones(instance.problem.m, dtype=bool)
        squares["bound"] += cramer_rao_rms_deg(instance.problem, inliers, noise, noise_deg) ** 2
        bounds = cramer_rao_variances(instance.problem, inliers, noise, noise_deg)
        flat = (3 - np.sqrt(9 - 4 * bounds)) / 2  # c_i of the bound 3 c_i (1 - c_i / 3)
        efficient += np.degrees(np.sqrt(8 * flat / np.pi)).mean()  # mean length of a Gaussian vector
        for name, method in methods.items():
            rotations = method.solve(instance.problem, np.random.default_rng(0)).rotations
            errors = camera_errors(rotations, instance.truth, "chordal")
            squares[name] += (errors**2).mean()
            if name == "l2":
                mean += errors.mean()
                mean_l1 += camera_errors(rotations, instance.truth, "l1").mean()
    ratio = {name: np.sqrt(squares[name] / squares["bound"]) for name in methods}
    assert ratio["l2"] == pytest.approx(1, abs=0.03)
    assert ratio["spectral"] == pytest.approx(1, abs=0.03)
    assert ratio["l1"] > 1.05
    assert mean == pytest.approx(efficient, rel=0.03)
    assert 0.98 * mean < mean_l1 < mean


def test_cameras_differ_as_the_bound_says() -> None:
    """On a long grid the ends are twice as uncertain as the middle, for least squares as for the bound."""
    edges, squares = grid_edges(2, 15), np.zeros(30)
    for seed in range(300):
        problem, truth = simulated(edges, noise_deg=2.0, seed=seed)
        squares += camera_errors(Spectral().solve(problem, np.random.default_rng(0)).rotations, truth, "chordal") ** 2
    expected = np.degrees(np.degrees(cramer_rao_variances(problem, np.ones(len(edges), dtype=bool), "tangent", 2.0)))
    np.testing.assert_allclose(squares / 300, expected, rtol=0.25)
    assert np.corrcoef(squares, expected)[0, 1] > 0.97
