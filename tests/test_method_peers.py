"""The relaxations and the outside implementations: exactness, certificates, agreement, honest failures."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated, transformed

from bench.core import so3
from bench.core.problem import Estimate, Floats, Problem
from bench.datasets.one_dsfm import OneDSfM
from bench.methods._lib.linear.certificate import chordal_cost, smallest_eigenvalue
from bench.methods.colmap import Colmap
from bench.methods.sdp import SDP
from bench.methods.shonan import Shonan
from bench.plugins.declare import Source

Peer = SDP | Shonan | Colmap

RNG = np.random.default_rng(0)
PAIR = random_edges(2, 1.0)
SMALL = random_edges(20, 0.3)
RING_LENGTH = 12

CERTIFIED = [
    pytest.param(SDP(), id="sdp"),
    pytest.param(SDP(solver="clarabel", eps=1e-8), id="clarabel"),
    pytest.param(Shonan(), id="shonan"),
]
EVERY_METHOD = pytest.mark.parametrize("method", [*CERTIFIED, Shonan(loss="huber"), Colmap()])


@pytest.fixture(autouse=True)
def _needs_pycolmap(request: pytest.FixtureRequest) -> None:
    """Skip, saying so, what needs the optional package."""
    parameters = getattr(request.node, "callspec", None)
    if "colmap" in request.node.name or (parameters and isinstance(parameters.params.get("method"), Colmap)):
        pytest.importorskip("pycolmap")


def about_z(degrees: float) -> Floats:
    return so3.exp(np.array([0, 0, np.radians(degrees)]))


def winding_ring() -> tuple[Problem, Floats]:
    """A ring whose measurements are all the identity, and the local minimum that winds around once."""
    edges = [[k, k + 1] for k in range(RING_LENGTH - 1)] + [[0, RING_LENGTH - 1]]
    problem = Problem(RING_LENGTH, np.array(edges), np.tile(np.eye(3), (RING_LENGTH, 1, 1)))
    return problem, np.array([about_z(360 * k / RING_LENGTH) for k in range(RING_LENGTH)])


@EVERY_METHOD
@pytest.mark.parametrize("edges", [PAIR, random_edges(5, 1.0), SMALL], ids=["pair", "complete", "random"])
def test_noise_free_problems_are_solved_exactly(method: Peer, edges: np.ndarray) -> None:
    problem, truth = simulated(edges)
    assert errors_deg(method.solve(problem, RNG).rotations, truth).max() < 1e-6


def test_the_first_order_solver_is_accurate_without_its_start(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, truth = simulated(SMALL)
    elsewhere = so3.random(np.random.default_rng(1), problem.n)
    monkeypatch.setattr("bench.methods.sdp.spectral_rotations", lambda *_: (elsewhere, None))
    estimate = SDP(eps=1e-8).solve(problem, RNG)
    assert estimate.iterations
    assert errors_deg(estimate.rotations, truth).max() < 1e-6


@EVERY_METHOD
def test_a_loop_error_is_shared_by_the_loop(method: Peer) -> None:
    """R_ij = R_i R_j^T of turns by 10, 10 and 26 degrees: 6 degrees too many, 2 for every edge."""
    problem = Problem(3, np.array([[0, 1], [1, 2], [0, 2]]), np.array([about_z(10), about_z(10), about_z(26)]))
    rotations = method.solve(problem, RNG).rotations
    relative = rotations[[0, 1, 0]] @ np.swapaxes(rotations[[1, 2, 2]], -1, -2)
    expected = np.array([about_z(12), about_z(12), about_z(24)])
    assert np.degrees(so3.angle_between(relative, expected)).max() < 0.01


@pytest.mark.parametrize("method", [*CERTIFIED, Shonan(loss="huber")])
def test_labels_and_edge_order_do_not_matter(method: Peer) -> None:
    problem, _ = simulated(SMALL, noise_deg=5, outliers=0.1)
    other, order = transformed(problem)
    first, second = method.solve(problem, RNG).rotations, method.solve(other, RNG).rotations
    assert errors_deg(second, first[order]).max() < 0.01


@pytest.mark.parametrize("method", [SDP(), Shonan(), Shonan(loss="huber"), Colmap()])
def test_the_seed_does_not_matter(method: Peer) -> None:
    problem, _ = simulated(SMALL, noise_deg=5, outliers=0.2)
    first, second = (method.solve(problem, np.random.default_rng(seed)).rotations for seed in (0, 1))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("outliers", [0.0, 0.2])
def test_the_certified_methods_find_one_optimum(outliers: float) -> None:
    problem, _ = simulated(SMALL, noise_deg=8, outliers=outliers)
    first, *others = (m.solve(problem, RNG) for m in (SDP(eps=1e-7), SDP(solver="clarabel", eps=1e-8), Shonan()))
    for estimate in (first, *others):
        assert estimate.cost == pytest.approx(first.cost, rel=1e-4)
        assert estimate.cost == chordal_cost(problem, estimate.rotations)
        assert estimate.certificate is not None
        assert abs(estimate.certificate) < 1e-2
        assert errors_deg(estimate.rotations, first.rotations).max() < 0.5


def test_the_certificate_is_negative_away_from_the_optimum_and_bounds_the_gap() -> None:
    problem, local = winding_ring()
    best = np.tile(np.eye(3), (problem.n, 1, 1))
    assert smallest_eigenvalue(problem, best) == pytest.approx(0, abs=1e-7)
    # Between neighbours the local minimum is off by a twelfth of a turn: Lambda = diag(2 cos, 2 cos, 2).
    assert smallest_eigenvalue(problem, local) == pytest.approx(2 * np.cos(2 * np.pi / 12) - 2, abs=1e-6)
    for rotations in (local, so3.random(np.random.default_rng(0), problem.n)):
        gap = chordal_cost(problem, rotations) - chordal_cost(problem, best)
        assert 0 < gap <= -3 * problem.n * smallest_eigenvalue(problem, rotations)


def test_shonan_climbs_out_of_a_local_minimum_or_says_that_it_could_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem, local = winding_ring()
    monkeypatch.setattr("bench.methods.shonan.spectral_rotations", lambda *_: (local, None))
    climbed, stuck = Shonan().solve(problem, RNG), Shonan(p_max=3).solve(problem, RNG)
    assert climbed.cost == pytest.approx(0, abs=1e-3)
    assert not climbed.notes
    assert stuck.cost == pytest.approx(chordal_cost(problem, local), rel=1e-3)
    assert stuck.certificate is not None
    assert stuck.certificate < -0.1
    assert "not certified" in stuck.notes[0]


def test_the_huber_loss_withstands_outliers_and_doubts_them() -> None:
    problem, truth = simulated(random_edges(40, 0.5), noise_deg=2, outliers=0.2)
    squared, huber = Shonan().solve(problem, RNG), Shonan(loss="huber").solve(problem, RNG)
    assert errors_deg(huber.rotations, truth).mean() < 0.5 * errors_deg(squared.rotations, truth).mean()
    assert huber.edge_weights is not None
    outlying = np.degrees(problem.residuals(truth)) > 30
    assert huber.edge_weights[outlying].max() < 0.2 < huber.edge_weights[~outlying].min()


@pytest.mark.parametrize("solver", ["scs", "clarabel"])
def test_a_solver_that_runs_out_of_iterations_says_so(solver: Literal["scs", "clarabel"]) -> None:
    problem, _ = simulated(SMALL, noise_deg=10, outliers=0.3)
    estimate = SDP(solver=solver, eps=1e-9, max_iterations=5).solve(problem, RNG)
    assert "did not reach eps=1e-09 in 5 iterations" in estimate.notes[0]
    assert np.isfinite(estimate.rotations).all()


def test_a_solver_without_a_solution_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.methods.sdp._solve_from_spectral", lambda *_: None)
    with pytest.raises(RuntimeError, match="scs ended without a solution; its status is 'None'"):
        SDP().solve(simulated(SMALL)[0], RNG)


def test_colmap_failure_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pycolmap.run_rotation_averaging", lambda *_: False)
    with pytest.raises(RuntimeError, match="weight_type=geman-mcclure reported failure"):
        Colmap().solve(simulated(SMALL)[0], RNG)


def test_colmap_cameras_without_pose_are_not_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pycolmap.run_rotation_averaging", lambda *_: True)
    assert np.isnan(Colmap().solve(simulated(SMALL)[0], RNG).rotations).all()


def test_colmap_trees_follow_the_weights() -> None:
    """A spanning tree of outliers cannot be left again; one of inliers need not be."""
    clean, truth = simulated(random_edges(30, 0.5), noise_deg=1, outliers=0.3)
    weights = np.where(np.degrees(clean.residuals(truth)) > 30, 1.0, 100.0)
    weighted = Problem(clean.n, clean.edges, clean.rotations, weights)
    assert np.median(errors_deg(Colmap().solve(weighted, RNG).rotations, truth)) < 1


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("method", "mean_deg", "median_deg"),
    [
        pytest.param(Shonan(), (6.3, 6.8), (2.7, 3.0), id="shonan"),
        pytest.param(Shonan(loss="huber"), (3.0, 4.5), (0.9, 1.25), id="huber"),
        pytest.param(Colmap(), (2.5, 3.1), (0.5, 0.6), id="colmap"),
    ],
)
def test_ellis_island(
    real_data: Path, method: Peer, mean_deg: tuple[float, float], median_deg: tuple[float, float]
) -> None:
    (source,) = OneDSfM(scene="Ellis_Island").sources(real_data / "1dsfm", 0)
    assert isinstance(source, Source)
    instance = source.load()
    assert instance.truth is not None
    estimate: Estimate = method.solve(instance.problem, RNG)
    errors = errors_deg(estimate.rotations, instance.truth)
    assert mean_deg[0] <= errors.mean() <= mean_deg[1]
    assert median_deg[0] <= np.median(errors) <= median_deg[1]
