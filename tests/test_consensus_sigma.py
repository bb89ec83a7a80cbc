"""The standard errors of consensus: how errors add up, whether they are correlated, wrong pieces, coverage."""

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated

from bench.core import so3
from bench.core.problem import Floats, Ints, Problem
from bench.datasets._simulated.correlated import Law
from bench.datasets._simulated.sizes import Sizes
from bench.datasets._simulated.streets import Street
from bench.methods._lib.consensus import propagation
from bench.methods._lib.consensus.correlation import correlation
from bench.methods._lib.consensus.propagation import added_up, strengths
from bench.methods._lib.consensus.rivals import rival_places
from bench.methods._lib.descent.iterate import Iterate
from bench.methods._lib.linear.laplacian import LaplacianSolver
from bench.methods.consensus import Consensus

RNG = np.random.default_rng(0)  # the method draws nothing from it


def shares(problem: Problem, truth: Floats) -> tuple[float, float]:
    """Shares of the cameras' errors within one and two sigma."""
    estimate = Consensus().solve(problem, RNG)
    assert estimate.camera_sigma is not None
    errors = np.radians(errors_deg(estimate.rotations, truth))
    return float((errors < estimate.camera_sigma).mean()), float((errors < 2 * estimate.camera_sigma).mean())


@pytest.mark.parametrize("edges", [grid_edges(1, 30), random_edges(30, 0.5)], ids=["sequence", "random"])
def test_errors_add_up_as_in_the_covariance_of_simulated_solutions(edges: Ints) -> None:
    problem, _ = simulated(edges)
    rng = np.random.default_rng(1)
    weights = rng.uniform(0.5, 2, problem.m)
    solver = LaplacianSolver(problem)
    found = added_up(problem, weights, solver.inverse(weights))
    solutions = np.concatenate(
        [solver.solve(weights, rng.standard_normal((problem.m, 3)) / np.sqrt(weights)[:, None]) for _ in range(1000)],
        axis=1,
    )
    deviation = solutions.std(axis=1)
    gauge = deviation**-1 / (deviation**-1).sum()
    wanted = (solutions - gauge @ solutions).std(axis=1) * np.sqrt(strengths(problem, weights))
    np.testing.assert_allclose(found, wanted, rtol=0.15)
    assert (found.max() > 2) == (len(edges) == 29)  # only along the sequence do errors add up


def test_draws_of_errors_tell_nearly_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, _ = simulated(grid_edges(2, 40))
    weights = np.ones(problem.m)
    inverse = LaplacianSolver(problem).inverse(weights)
    exact = added_up(problem, weights, inverse)
    monkeypatch.setattr(propagation, "EXACT", 0)
    ratio = added_up(problem, weights, inverse) / exact
    assert 0.7 < np.median(ratio) < 1.4
    assert ratio.min() > 0.4


def test_correlated_errors_are_told_from_independent_ones() -> None:
    """Around the true cameras."""
    edges, n = Street(40, closed=True).edges(150, np.random.default_rng(0)), 150
    for law, correlated in ((Law(Sizes()), True), (Law.independent(Sizes(), Law().cameras), False)):
        for seed in range(3):
            truth, rotations, _ = law.simulate(n, edges, np.random.default_rng(seed))
            at = Iterate.at(Problem(n, edges, rotations), truth)
            chance = correlation(Problem(n, edges, rotations), at.vectors, at.angles, np.full(len(edges), 0.02))
            assert (chance > 0.9) if correlated else (chance < 0.1)


def folded(right: float) -> tuple[Problem, Floats]:
    """Crowds of 20 and 40 cameras; of the measurements across a share is `right`, the others are off by 60 degrees."""
    rng = np.random.default_rng(0)
    across = np.stack([rng.integers(0, 20, 60), rng.integers(20, 60, 60)], axis=1)
    edges = np.concatenate([random_edges(20, 0.8), random_edges(40, 0.5) + 20, across])
    edges = np.unique(edges, axis=0).astype(np.int32)
    problem, truth = simulated(edges, noise_deg=0.5)
    rotations = problem.rotations.copy()
    bridges = np.flatnonzero((edges[:, 0] < 20) & (edges[:, 1] >= 20))
    wrong = rng.permutation(bridges)[round(right * len(bridges)) :]
    seen = truth[edges[wrong, 0]]
    rotations[wrong] = seen @ so3.exp(np.radians([0.0, 60.0, 0.0])) @ np.swapaxes(seen, -1, -2) @ rotations[wrong]
    return Problem(60, edges, rotations), truth


@pytest.mark.parametrize(("right", "doubtful"), [(0.6, True), (0.95, False)])
def test_a_piece_that_others_would_turn_is_doubtful(right: float, doubtful: bool) -> None:
    problem, truth = folded(right)
    at = Iterate.at(problem, truth)
    agreement = (1 + (at.angles / np.radians(2)) ** 2) ** -2
    probable, possible = rival_places(
        problem, at.vectors, at.angles, agreement, np.radians(1), LaplacianSolver(problem).inverse
    )
    assert probable.max() == 0  # most are right
    turned = np.degrees(possible)
    np.testing.assert_allclose(turned[:20], 60 if doubtful else 0, atol=3)
    assert turned[20:].max() == 0


def test_a_camera_with_one_edge_is_doubtful_where_many_edges_are_wrong() -> None:
    crowd = random_edges(30, 0.8)
    edges = np.concatenate([crowd, [[0, 30]]]).astype(np.int32)
    for outliers in (0.0, 0.5):
        problem, _ = simulated(edges, noise_deg=0.5, outliers=outliers)
        sigma = Consensus().solve(problem, RNG).camera_sigma
        assert sigma is not None
        assert (np.degrees(sigma[30]) > 60) == (outliers > 0)
        assert np.degrees(np.median(sigma[:30])) < 1


def test_sigma_covers_a_fold() -> None:
    """Whether the solution follows the measurements across that are wrong all alike (here of 30 %), or not (of 58)."""
    for right in (0.3, 0.58):
        _, two = shares(*folded(right))
        assert two > 0.9


def test_sigma_covers_independent_errors() -> None:
    covered = []
    for seed in range(4):
        problem, truth = simulated(random_edges(100, 0.5, seed), noise_deg=5.0, outliers=0.4, seed=seed)
        covered.append(shares(problem, truth))
    one, two = np.mean(covered, axis=0)
    assert 0.55 < one < 0.85
    assert two > 0.9


def test_sigma_covers_correlated_errors() -> None:
    covered = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        edges = Street.drawn(40, seed % 2 == 0, rng).edges(120, rng)
        truth, rotations, _ = Law.drawn(rng).simulate(120, edges, rng)
        covered.append(shares(Problem(120, edges, rotations), truth))
    one, two = np.mean(covered, axis=0)
    assert 0.55 < one < 0.85
    assert 0.88 < two < 0.99
