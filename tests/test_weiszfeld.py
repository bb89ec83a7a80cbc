"""Weiszfeld's sweeps: against a general optimizer, and what they recover."""

from pathlib import Path

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated, transformed
from scenes import load
from scipy.optimize import minimize

from bench.core import so3
from bench.core.problem import Floats, Problem
from bench.datasets.one_dsfm import OneDSfM
from bench.methods._lib.starts import Start
from bench.methods.weiszfeld import Weiszfeld

RNG = np.random.default_rng(0)
DENSE = random_edges(60, 0.4)
EVERY_START = pytest.mark.parametrize("init", ["spectral", "spanning-tree"])


def about_z(degrees: float) -> Floats:
    return so3.exp(np.array([0, 0, np.radians(degrees)]))


def test_one_camera_goes_to_the_median_of_its_neighbours() -> None:
    """Five cameras agree on the sixth by 0, 1, 2, 50 and 60 degrees; the median is 2, whatever the last are."""
    agree = [(i, j) for i in range(5) for j in range(i + 1, 5)]
    votes = [(i, 5) for i in range(5)]
    rotations = [np.eye(3)] * len(agree) + [about_z(-angle) for angle in (0, 1, 2, 50, 60)]
    problem = Problem(6, np.array(agree + votes), np.array(rotations))
    found = Weiszfeld(tolerance_deg=1e-6).solve(problem, RNG).rotations
    assert np.degrees(so3.angle_between(found[5] @ found[0].T, about_z(2))) < 1e-3


@EVERY_START
def test_a_general_optimizer_finds_no_lower_cost(init: Start) -> None:
    problem, _ = simulated(random_edges(10, 0.8), noise_deg=8, outliers=0.1)
    estimate = Weiszfeld(init=init, tolerance_deg=1e-7, sweeps=5000).solve(problem, RNG)

    def cost(steps: Floats) -> float:
        return float(problem.residuals(estimate.rotations @ so3.exp(steps.reshape(-1, 3))).sum())

    for seed in range(3):
        elsewhere = 0.05 * np.random.default_rng(seed).standard_normal(3 * problem.n)
        assert cost(elsewhere) > cost(np.zeros(3 * problem.n))
        found = minimize(cost, elsewhere, method="L-BFGS-B", options={"maxiter": 2000, "maxfun": 10**6})
        assert estimate.cost == pytest.approx(cost(np.zeros(3 * problem.n)))
        assert found.fun >= estimate.cost * (1 - 1e-6)
        assert found.fun == pytest.approx(estimate.cost, rel=1e-2)


@EVERY_START
def test_outliers_are_rejected(init: Start) -> None:
    problem, truth = simulated(DENSE, outliers=0.2)
    estimate = Weiszfeld(init=init, tolerance_deg=1e-6).solve(problem, RNG)
    assert errors_deg(estimate.rotations, truth).max() < 0.01


def test_a_random_start_is_good_enough_on_a_dense_graph_without_outliers() -> None:
    problem, truth = simulated(DENSE)
    estimate = Weiszfeld(init="random").solve(problem, RNG)
    assert errors_deg(estimate.rotations, truth).max() < 0.1


@EVERY_START
def test_labels_and_edge_order_do_not_matter(init: Start) -> None:
    problem, _ = simulated(DENSE, noise_deg=3, outliers=0.1)
    other, order = transformed(problem)
    first, second = (Weiszfeld(init=init).solve(p, RNG).rotations for p in (problem, other))
    assert errors_deg(second, first[order]).max() < 1e-6


def test_a_sweep_never_raises_the_cost() -> None:
    problem, _ = simulated(DENSE, noise_deg=5, outliers=0.4)
    costs = [Weiszfeld(sweeps=k).solve(problem, RNG).cost for k in range(12)]
    assert None not in costs
    assert np.all(np.diff(np.array(costs)) <= 0)


@pytest.mark.real_data
@EVERY_START
def test_ellis_island(real_data: Path, init: Start) -> None:
    instance = load(OneDSfM(scene="Ellis_Island"), real_data / "1dsfm")
    assert instance.truth is not None
    errors = errors_deg(Weiszfeld(init=init).solve(instance.problem, RNG).rotations, instance.truth)
    assert 3.1 < errors.mean() < 3.5
    assert 0.75 < np.median(errors) < 0.82
