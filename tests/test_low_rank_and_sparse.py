"""R-GoDec and the nuclear norm: against dense and convex solvers, and what they recover."""

from pathlib import Path

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated, transformed

from bench.core.problem import Floats, Problem
from bench.methods import r_godec
from bench.methods.nuclear_norm import NuclearNorm, Program
from bench.methods.r_godec import RGoDec
from bench.methods.spectral import Spectral

RNG = np.random.default_rng(0)  # the methods here draw nothing from it
EDGES = random_edges(50, 0.5)
EVERY_METHOD = pytest.mark.parametrize("method", [RGoDec(), NuclearNorm()], ids=str)


def dense_view(problem: Problem) -> tuple[Floats, Floats]:
    """The measured matrix (3n, 3n), identities on its diagonal, and the mask of what is in it."""
    matrix = problem.block_matrix(diagonal=np.ones(problem.n)).toarray()
    pattern = problem.adjacency().toarray() + np.eye(problem.n)
    return matrix, np.kron(pattern, np.ones((3, 3)))


@EVERY_METHOD
def test_outliers_are_rejected(method: RGoDec | NuclearNorm) -> None:
    problem, truth = simulated(EDGES, noise_deg=2, outliers=0.2)
    squares = errors_deg(Spectral().solve(problem, RNG).rotations, truth).mean()
    estimate = method.solve(problem, RNG)
    assert errors_deg(estimate.rotations, truth).mean() < 0.5 * squares
    assert estimate.edge_weights is not None
    outlying = problem.residuals(truth) > np.radians(20)
    assert estimate.edge_weights[outlying].max() < np.median(estimate.edge_weights[~outlying])


@EVERY_METHOD
def test_labels_and_edge_order_do_not_matter(method: RGoDec | NuclearNorm) -> None:
    problem, _ = simulated(EDGES, noise_deg=3, outliers=0.1)
    other, order = transformed(problem)
    first, second = method.solve(problem, RNG).rotations, method.solve(other, RNG).rotations
    assert errors_deg(second, first[order]).max() < 0.1


def test_a_step_of_r_godec_is_that_of_dense_matrices() -> None:
    problem, _ = simulated(EDGES, noise_deg=5, outliers=0.2)
    matrix, mask = dense_view(problem)
    model = r_godec.model(problem, "spectral", 0.1, RNG)
    basis = model.rotations().reshape(-1, 3)
    low_rank = basis @ basis.T
    sparse = mask * np.sign(matrix - low_rank) * np.maximum(np.abs(matrix - low_rank) - 0.1, 0)
    loss = np.sum((mask * (matrix - low_rank - sparse)) ** 2) / 2 + 0.1 * np.abs(sparse).sum()
    assert model.cost() == pytest.approx(loss)
    completed = np.where(mask > 0, matrix - sparse, low_rank)
    for _ in range(r_godec.SUBSPACE_STEPS):
        basis = np.linalg.qr(completed @ basis)[0]
    projected = basis @ (basis.T @ completed @ basis) @ basis.T
    moved = model.step()
    np.testing.assert_allclose(moved, np.linalg.norm(projected - low_rank), rtol=1e-9)
    i, j = problem.edges.T
    blocks = projected.reshape(problem.n, 3, problem.n, 3)[i, :, j]
    np.testing.assert_allclose(model.residuals()[0], problem.rotations - blocks, atol=1e-12)


def test_r_godec_ends_at_the_same_objective_from_every_start() -> None:
    problem, _ = simulated(EDGES, noise_deg=3, outliers=0.1)
    methods = [RGoDec(init=init, iterations=3000, tolerance=1e-9) for init in ("zero-filled", "spectral")]  # type: ignore[arg-type]
    zero_filled, spectral = (method.solve(problem, RNG) for method in methods)
    assert zero_filled.stop_reason == "L changed by less than 1e-09"
    assert zero_filled.cost == pytest.approx(spectral.cost, rel=1e-6)
    assert errors_deg(zero_filled.rotations, spectral.rotations).max() < 1e-3


def test_the_nuclear_norm_program_has_the_optimum_that_cvxpy_finds() -> None:
    import cvxpy

    problem, _ = simulated(random_edges(6, 0.6), noise_deg=10, outliers=0.2, seed=1)
    estimate = NuclearNorm(iterations=5000, tolerance=1e-7).solve(problem, RNG)
    matrix, mask = dense_view(problem)
    weight = Program(problem, 0.5, np.tile(np.eye(3), (problem.n, 1, 1))).misfit_weight
    assert weight == pytest.approx(0.5 / np.sqrt(mask.mean() * len(mask)))
    z = cvxpy.Variable(matrix.shape, symmetric=True)
    misfit = cvxpy.sum(cvxpy.abs(cvxpy.multiply(mask, z - matrix)))
    identities = [z[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] == np.eye(3) for k in range(problem.n)]
    program = cvxpy.Problem(cvxpy.Minimize(cvxpy.normNuc(z) + weight * misfit), identities)
    optimum = program.solve(solver="SCS", eps=1e-6, max_iters=20000)
    assert estimate.cost == pytest.approx(optimum, rel=1e-4)


def test_the_subspace_iteration_finds_the_optimum_of_lapack(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, _ = simulated(EDGES, noise_deg=3, outliers=0.1)
    method = NuclearNorm(iterations=400, tolerance=1e-4)
    exact = method.solve(problem, RNG)
    monkeypatch.setattr("bench.methods.nuclear_norm.SMALL", 1)
    assert method.solve(problem, RNG).cost == pytest.approx(exact.cost, rel=1e-4)


@pytest.mark.real_data
def test_ellis_island(real_data: Path) -> None:
    from bench.datasets.one_dsfm import OneDSfM

    sources = OneDSfM(scene="Ellis_Island").sources(real_data / "1dsfm", 0)
    instance = next(iter(sources)).load()  # type: ignore[union-attr]
    assert instance.truth is not None
    found = errors_deg(RGoDec().solve(instance.problem, RNG).rotations, instance.truth)
    assert found.mean() < 4.5
    assert np.median(found) < 1.5
