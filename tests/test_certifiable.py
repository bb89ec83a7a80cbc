"""The l2 family: one optimum, honest certificates, and the parts against references."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated

from bench.core import so3
from bench.core.problem import Estimate, Floats, Problem
from bench.datasets.erdos_renyi import ErdosRenyi
from bench.methods._lib.graph.neighbours import neighbours_of
from bench.methods._lib.linear import eigen
from bench.methods._lib.linear.certificate import certificate_matrix, chordal_cost, multipliers
from bench.methods._lib.loops import camera_kernels
from bench.methods.bcd import BCD
from bench.methods.maks import MAKS
from bench.methods.rcd import RCD
from bench.methods.sdp import SDP
from bench.methods.shonan import Shonan
from bench.methods.staircase import Staircase

RNG = np.random.default_rng(0)
SMALL = random_edges(20, 0.3)
FAMILY = [RCD(), BCD(), BCD(init="spectral"), MAKS(), MAKS(init="spectral"), Staircase(), Shonan(), SDP()]
OURS = [RCD, BCD, MAKS, Staircase]


def proves_optimality(problem: Problem, estimate: Estimate) -> bool:
    """Whether the certificate bounds the gap of the cost below 1e-6 of it."""
    assert estimate.certificate is not None
    assert estimate.cost == pytest.approx(chordal_cost(problem, estimate.rotations))
    return -3 * problem.n * estimate.certificate <= 1e-6 * estimate.cost


def winding_ring() -> tuple[Problem, Floats]:
    """A ring of twelve whose measurements are all the identity, and the local minimum that winds around once."""
    edges = [[k, k + 1] for k in range(11)] + [[0, 11]]
    turns = so3.exp(2 * np.pi / 12 * np.arange(12)[:, None] * np.array([0.0, 0.0, 1.0]))
    return Problem(12, np.array(edges), np.tile(np.eye(3), (12, 1, 1))), turns


@pytest.mark.parametrize(("n", "missing", "outliers"), [(20, 0.5, 0.1), (30, 0.6, 0.1), (40, 0.7, 0.15)])
def test_the_family_finds_one_optimum_and_proves_it(n: int, missing: float, outliers: float) -> None:
    (source,) = ErdosRenyi(n=n, missing=missing, outliers=outliers).sources(None, 0)
    problem = source.load().problem
    costs = {}
    for method in FAMILY:
        estimate = method.solve(problem, RNG)
        assert proves_optimality(problem, estimate), method
        assert not estimate.notes
        costs[str(method)] = estimate.cost
    assert max(costs.values()) == pytest.approx(min(costs.values()), rel=1e-6), costs


@pytest.mark.parametrize("method", [BCD(init="random"), MAKS(init="random"), Staircase(init="random")], ids=str)
def test_a_random_start_leads_to_the_same_optimum(method: Any) -> None:
    problem, _ = simulated(random_edges(25, 0.4), noise_deg=10, outliers=0.1)
    best = Staircase().solve(problem, RNG).cost
    assert method.solve(problem, np.random.default_rng(1)).cost == pytest.approx(best, rel=1e-6)


@pytest.mark.parametrize("method", [RCD(), BCD(), MAKS(), MAKS(update="published"), Staircase()], ids=str)
@pytest.mark.parametrize("edges", [random_edges(2, 1.0), SMALL, grid_edges(3, 8)], ids=["pair", "random", "grid"])
def test_noise_free_problems_are_solved_exactly(method: Any, edges: np.ndarray) -> None:
    problem, truth = simulated(edges)
    estimate = method.solve(problem, RNG)
    assert errors_deg(estimate.rotations, truth).max() < 1e-5
    assert "limit" not in estimate.stop_reason


@pytest.mark.parametrize("module", ["rcd", "bcd", "maks", "staircase"])
def test_a_local_minimum_is_left_or_known_for_what_it_is(monkeypatch: pytest.MonkeyPatch, module: str) -> None:
    problem, local = winding_ring()
    monkeypatch.setattr(f"bench.methods.{module}.start_rotations", lambda *_: local)
    method = {"rcd": RCD(), "bcd": BCD(init="random"), "maks": MAKS(init="random"), "staircase": Staircase()}[module]
    estimate = method.solve(problem, RNG)
    if module == "rcd":
        assert estimate.cost == pytest.approx(chordal_cost(problem, local))
        assert estimate.certificate == pytest.approx(2 * np.cos(2 * np.pi / 12) - 2, abs=1e-6)
    else:
        assert estimate.cost == pytest.approx(0, abs=1e-8)
    if module == "staircase":
        assert estimate.stop_reason.startswith("certified at p = ")
        stuck = Staircase(p_max=3).solve(problem, RNG)
        assert "not certified up to p=3" in stuck.notes[0]
        assert stuck.cost == pytest.approx(chordal_cost(problem, local))


def test_coordinate_steps_are_projections_and_know_their_gain() -> None:
    problem, _ = simulated(SMALL, noise_deg=20, outliers=0.5)
    rotations = so3.random(np.random.default_rng(1), problem.n)
    wanted, gain, seen = rotations.copy(), np.empty(1), neighbours_of(problem)
    measurements = problem.block_matrix()
    for k in range(problem.n):
        wanted[k] = so3.project(measurements[3 * k : 3 * k + 3] @ wanted.reshape(-1, 3))
    before = chordal_cost(problem, rotations)
    camera_kernels.rotation_sweep(seen.first, seen.cameras, seen.rotations, rotations, gain)
    np.testing.assert_allclose(rotations, wanted, atol=1e-12)
    assert before - chordal_cost(problem, rotations) == pytest.approx(2 * gain[0])


@pytest.mark.parametrize("kind", ["reflection", "rank two", "tiny", "zero"])
def test_a_coordinate_step_survives_singular_sums(kind: str) -> None:
    """One camera with one neighbour at the identity: the sum is whatever matrix is given as measured."""
    rng = np.random.default_rng(0)
    matrix = rng.standard_normal((3, 3))
    if kind == "reflection":
        matrix *= -np.sign(np.linalg.det(matrix))
    elif kind == "rank two":
        matrix[2] = matrix[0] + matrix[1]
    else:
        matrix *= 1e-200 if kind == "tiny" else 0.0
    rotations = np.stack([np.eye(3), np.eye(3)])
    first, neighbours = np.array([0, 1, 1], dtype=np.int32), np.array([1], dtype=np.int32)
    camera_kernels.rotation_sweep(first, neighbours, matrix[None], rotations, np.empty(1))
    assert np.abs(rotations[0] @ rotations[0].T - np.eye(3)).max() < 1e-12
    assert np.linalg.det(rotations[0]) == pytest.approx(1)
    if kind in ("reflection", "rank two"):
        np.testing.assert_allclose(rotations[0], so3.project(matrix), atol=1e-12)


@pytest.mark.parametrize("path", ["lapack", "factors", "diagonal"])
@pytest.mark.parametrize("edges", [random_edges(60, 0.2), grid_edges(5, 14)], ids=["random", "grid"])
def test_the_smallest_eigenvalues_are_those_of_lapack(
    monkeypatch: pytest.MonkeyPatch, path: str, edges: np.ndarray
) -> None:
    problem, _ = simulated(edges, noise_deg=15, outliers=0.1)
    measurements = problem.block_matrix()
    rotations = Staircase(max_iterations=1).solve(problem, RNG).rotations
    matrix = certificate_matrix(measurements, multipliers(measurements, rotations))
    monkeypatch.setattr(eigen, "SMALL", 10**6 if path == "lapack" else 0)
    monkeypatch.setattr(eigen, "NARROW", 1.0 if path == "factors" else 0.0)
    found = eigen.smallest(matrix, np.random.default_rng(1).standard_normal((3 * problem.n, 3)), 1e-6)
    np.testing.assert_allclose(found.values, np.linalg.eigvalsh(matrix.toarray())[:3], atol=1e-8)
    np.testing.assert_allclose(matrix @ found.vectors, found.vectors * found.values, atol=1e-3)


def test_the_relaxed_cost_of_maks_bounds_the_optimum_from_below() -> None:
    problem, _ = simulated(SMALL, noise_deg=20, outliers=0.2)
    loose, tight = MAKS(tolerance=1e-2).solve(problem, RNG), MAKS(tolerance=1e-10).solve(problem, RNG)
    assert loose.cost is not None
    assert tight.cost is not None
    assert tight.cost <= loose.cost <= tight.cost * (1 + 1.02e-2)
    assert loose.stop_reason == "gap below 0.01 of the cost"


def test_limits_are_reported() -> None:
    problem, _ = simulated(SMALL, noise_deg=20, outliers=0.3)
    for method in (RCD(max_epochs=1), BCD(max_epochs=1), MAKS(max_iterations=1)):
        estimate = method.solve(problem, RNG)
        assert estimate.iterations == 1
        assert "limit" in estimate.stop_reason


@pytest.mark.real_data
def test_ellis_island(real_data: Path) -> None:
    from bench.datasets.one_dsfm import OneDSfM

    sources = OneDSfM(scene="Ellis_Island").sources(real_data / "1dsfm", 0)
    instance = next(iter(sources)).load()  # type: ignore[union-attr]
    for method in (RCD(), MAKS(), Staircase(), BCD(), Shonan()):
        estimate = method.solve(instance.problem, RNG)
        assert estimate.cost == pytest.approx(5543.9145283, rel=1e-6)
        assert proves_optimality(instance.problem, estimate), method
    errors = errors_deg(estimate.rotations, instance.truth)
    assert errors.mean() == pytest.approx(6.57, abs=0.05)
    assert np.median(errors) == pytest.approx(2.90, abs=0.05)
