"""Which loss consensus ends with: wide where errors are normal, Cauchy's where they crowd near zero."""

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated

from bench.core import so3
from bench.core.problem import Floats, Problem
from bench.datasets._simulated.correlated import Law
from bench.datasets._simulated.streets import Street
from bench.methods._lib.consensus import efficiency
from bench.methods._lib.consensus.efficiency import Fit, most_precise, standard_error
from bench.methods._lib.consensus.half_edges import HalfEdges
from bench.methods._lib.consensus.settling import CAUCHY, GEMAN_MCCLURE, Settling
from bench.methods._lib.descent.descent import Descent


def crowded(seed: int) -> tuple[Problem, Floats]:
    """Errors about random axes whose angles are normal, as in the paper; 40 % of the edges are wrong."""
    rng = np.random.default_rng(seed)
    problem, truth = simulated(random_edges(100, 0.5, seed), outliers=0.4, seed=seed)
    axes = rng.standard_normal((problem.m, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    noise = so3.exp(np.radians(5) * rng.standard_normal((problem.m, 1)) * axes)
    return Problem(problem.n, problem.edges, problem.rotations @ noise), truth


def fitted(problem: Problem, truth: Floats) -> Fit:
    """The choice, from the true cameras."""
    settling = Settling(problem, HalfEdges.of(problem), np.ones(problem.m), agreeing=5)
    descent = Descent(problem, truth, 0.0)
    return most_precise(problem, settling, descent, settling.settle(descent, np.radians(2), 12))


def test_the_standard_error_is_that_of_the_mean_where_the_loss_is_wide() -> None:
    problem, _ = simulated(random_edges(40, 1.0))
    angles = np.full(problem.m, 0.02)
    found = standard_error(problem, np.ones(problem.m), angles, np.full(problem.n, 1e3), GEMAN_MCCLURE) * 1e3
    leverage = 2 / 39
    assert found == pytest.approx(0.02 / (1 - leverage) / np.sqrt(3 * 39), rel=1e-6)


def test_errors_that_crowd_near_zero_are_averaged_by_cauchy(monkeypatch: pytest.MonkeyPatch) -> None:
    graphs = [crowded(seed) for seed in range(4)]
    fits = [fitted(*graph) for graph in graphs]
    assert {fit.power for fit in fits} == {CAUCHY}
    monkeypatch.setattr(efficiency, "NARROWER", ())
    others = [fitted(*graph) for graph in graphs]
    assert {fit.power for fit in others} == {GEMAN_MCCLURE}
    pairs = [zip(found, graphs, strict=True) for found in (fits, others)]
    errors = [[errors_deg(so3.from_quaternion(fit.cameras), truth) for fit, (_, truth) in pair] for pair in pairs]
    assert np.mean(errors[0]) < 0.96 * np.mean(errors[1])


def test_normal_errors_are_averaged_by_a_wide_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, truth = simulated(random_edges(60, 0.5), noise_deg=3, outliers=0.2)
    fit = fitted(problem, truth)
    assert fit.power == GEMAN_MCCLURE
    monkeypatch.setattr(efficiency, "WIDER", ())
    monkeypatch.setattr(efficiency, "NARROWER", ())
    narrow = fitted(problem, truth)
    assert np.median(fit.scales) > 1.5 * np.median(narrow.scales)
    errors = [errors_deg(so3.from_quaternion(found.cameras), truth).mean() for found in (fit, narrow)]
    assert errors[0] < 0.9 * errors[1]


def test_correlated_errors_are_left_to_a_narrow_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    """Although Cauchy's promises more there."""
    graphs = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        edges = Street(40, closed=True).edges(150, rng)
        truth, rotations, _ = Law.drawn(rng).simulate(150, edges, rng)
        graphs.append((Problem(150, edges, rotations), truth))
    assert {fitted(*graph).power for graph in graphs} == {GEMAN_MCCLURE}
    monkeypatch.setattr(efficiency, "INDEPENDENT", 2.0)
    assert CAUCHY in {fitted(*graph).power for graph in graphs}
