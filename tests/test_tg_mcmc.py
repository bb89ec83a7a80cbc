"""TG-MCMC: its forces against finite differences, its samples against the density, its minimum against Shonan's."""

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated, transformed

from bench.core import so3
from bench.core.problem import Floats, Ints, Problem
from bench.methods._lib.linear.certificate import chordal_cost, smallest_eigenvalue
from bench.methods._lib.loops import geodesic_kernels
from bench.methods.tg_mcmc import TGMCMC

GRAPHS = {"dense": random_edges(40, 0.4), "sparse": random_edges(60, 0.06), "grid": grid_edges(4, 8)}
EVERY_GRAPH = pytest.mark.parametrize("edges", GRAPHS.values(), ids=GRAPHS)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def energy_and_forces(problem: Problem, cameras: Floats) -> tuple[float, Floats]:
    forces, energy = np.empty_like(cameras), np.empty(1)
    measured = so3.to_quaternion(problem.rotations)
    geodesic_kernels.bingham_forces(problem.edges, measured, np.ones(problem.m), cameras, forces, energy)
    return float(energy[0]), forces


def test_forces_are_minus_the_gradient() -> None:
    problem, _ = simulated(random_edges(6, 0.6), outliers=1.0)
    cameras, direction = rng(1).standard_normal((2, 6, 4))
    _, forces = energy_and_forces(problem, cameras)
    above, _ = energy_and_forces(problem, cameras + 1e-5 * direction)
    below, _ = energy_and_forces(problem, cameras - 1e-5 * direction)
    assert -(forces * direction).sum() == pytest.approx((above - below) / 2e-5, rel=1e-6)


def test_the_energy_is_an_eighth_of_the_chordal_cost() -> None:
    problem, _ = simulated(random_edges(10, 0.5), outliers=0.5)
    rotations = so3.random(rng(1), 10)
    signs = rng(2).choice([-1.0, 1.0], (10, 1))
    energy, _ = energy_and_forces(problem, signs * so3.to_quaternion(rotations))
    assert 8 * energy == pytest.approx(chordal_cost(problem, rotations))


def test_a_step_without_forces_follows_a_great_circle() -> None:
    camera, velocity = np.array([[1.0, 0, 0, 0]]), np.array([[0, 0.3, 0, 0.4]])
    still = np.zeros((1, 4))
    geodesic_kernels.geodesic_step(camera, velocity, still, np.ones(1), still, 1.0, 2.0)
    np.testing.assert_allclose(camera, [[np.cos(1), 0.6 * np.sin(1), 0, 0.8 * np.sin(1)]], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(velocity), 0.5, atol=1e-12)
    np.testing.assert_allclose((camera * velocity).sum(), 0, atol=1e-12)


def test_at_a_constant_temperature_the_samples_have_the_bingham_density() -> None:
    """One edge at beta: near its mode the residual is Gaussian, with variance 2 / beta about each axis."""
    edge = Problem(2, np.array([[0, 1]], dtype=np.int32), np.eye(3)[None])
    measured, noise = so3.to_quaternion(edge.rotations), 0.05
    cameras = np.tile([1.0, 0, 0, 0], (2, 1))
    velocities, forces, energy = np.zeros((2, 4)), np.zeros((2, 4)), np.zeros(1)
    generator, keep, squares = rng(3), 0.9, []
    for step in range(40_000):
        geodesic_kernels.bingham_forces(edge.edges, measured, np.ones(edge.m), cameras, forces, energy)
        kicks = np.sqrt((1 - keep**2) * noise**2 / 2) * generator.standard_normal((2, 4))
        geodesic_kernels.geodesic_step(cameras, velocities, forces, np.ones(2), kicks, keep, 0.2)
        if step > 100:
            squares.append(4 * energy[0])  # the squared residual angle, sine taken for the angle
    assert np.sqrt(np.mean(squares) / 3) == pytest.approx(noise, rel=0.1)


@EVERY_GRAPH
@pytest.mark.parametrize("init", ["spanning-tree", "spectral"])
def test_noise_free_problems_are_solved(edges: Ints, init: str) -> None:
    problem, truth = simulated(edges)
    estimate = TGMCMC(init=init).solve(problem, rng())  # type: ignore[arg-type]
    assert errors_deg(estimate.rotations, truth).max() < 1e-4
    assert estimate.stop_reason == "root mean square step below 1e-06 degrees"


@pytest.mark.parametrize("seed", range(3))
def test_from_anywhere_the_certified_optimum_is_reached(seed: int) -> None:
    problem, _ = simulated(GRAPHS["dense"], noise_deg=10, outliers=0.1)
    estimate = TGMCMC(init="random").solve(problem, rng(seed))
    assert estimate.cost == pytest.approx(chordal_cost(problem, estimate.rotations))
    assert smallest_eigenvalue(problem, estimate.rotations) > -1e-6


def test_its_cost_is_shonans() -> None:
    pytest.importorskip("gtsam")
    from bench.methods.shonan import Shonan

    problem, _ = simulated(GRAPHS["sparse"], noise_deg=5, outliers=0.05)
    shonans = Shonan(loss="l2").solve(problem, rng()).cost
    cost = TGMCMC().solve(problem, rng()).cost
    assert shonans is not None
    assert cost is not None
    assert cost == pytest.approx(shonans, rel=1e-4)
    assert cost < shonans * (1 + 1e-9)


def test_labels_and_edge_order_do_not_matter() -> None:
    problem, _ = simulated(GRAPHS["dense"], noise_deg=5)
    other, order = transformed(problem)
    first, second = TGMCMC().solve(problem, rng(0)), TGMCMC().solve(other, rng(1))
    assert errors_deg(second.rotations, first.rotations[order]).max() < 1e-4


def test_it_cools_and_stops_at_the_limit() -> None:
    problem, _ = simulated(GRAPHS["dense"], noise_deg=5)
    estimate = TGMCMC(cooling=50, iterations=100, checkpoint_every=25, tolerance_deg=1e-12).solve(problem, rng())
    assert estimate.stop_reason == "iteration limit"
    assert [c.iteration for c in estimate.checkpoints] == [0, 25, 50, 75, 100]
    costs = [c.diagnostics["cost"] for c in estimate.checkpoints]
    assert costs[-1] < costs[1]
