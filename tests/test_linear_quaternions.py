"""Quaternion least squares and Martinec-Pajdla: against dense solvers, and what they recover."""

from pathlib import Path

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated, transformed

from bench.core import so3
from bench.core.problem import Floats, Ints, Problem
from bench.methods._lib.linear.eigen import PRECISE, smallest
from bench.methods._lib.linear.laplacian import block_laplacian
from bench.methods.martinec_pajdla import MartinecPajdla, laplacian_rotations
from bench.methods.quaternion import Quaternion

RNG = np.random.default_rng(0)  # only random starts draw from it
SMALL = random_edges(20, 0.3)
RANDOM = random_edges(150, 0.15)
GRID = grid_edges(6, 30)
RING = np.array([[k, k + 1] for k in range(299)] + [[0, 299]], dtype=np.int32)
EVERY_GRAPH = pytest.mark.parametrize("edges", [SMALL, RANDOM, GRID, RING], ids=["small", "random", "grid", "ring"])
EVERY_METHOD = pytest.mark.parametrize("method", [MartinecPajdla(), Quaternion(), Quaternion(init="spectral")], ids=str)


def dense_laplacian(problem: Problem, blocks: Floats) -> Floats:
    """Normal matrix of the equations x_i = B_ij x_j, stacked edge by edge."""
    k = blocks.shape[-1]
    equations = np.zeros((problem.m, k, problem.n, k))
    for e, (i, j) in enumerate(problem.edges):
        equations[e, :, i] = np.eye(k)
        equations[e, :, j] = -blocks[e]
    stacked = equations.reshape(problem.m * k, problem.n * k)
    return stacked.T @ stacked


@EVERY_GRAPH
@EVERY_METHOD
def test_noise_free_problems_are_solved_exactly(method: MartinecPajdla | Quaternion, edges: Ints) -> None:
    problem, truth = simulated(edges)
    assert errors_deg(method.solve(problem, RNG).rotations, truth).max() < 1e-7


@EVERY_GRAPH
@EVERY_METHOD
def test_labels_and_edge_order_do_not_matter(method: MartinecPajdla | Quaternion, edges: Ints) -> None:
    problem, _ = simulated(edges, noise_deg=3)
    other, order = transformed(problem)
    first, second = method.solve(problem, RNG).rotations, method.solve(other, RNG).rotations
    assert errors_deg(second, first[order]).max() < 1e-5


@EVERY_GRAPH
def test_martinec_pajdla_agrees_with_a_dense_eigensolver(edges: Ints) -> None:
    problem, _ = simulated(edges, noise_deg=10, seed=2)
    reference = np.linalg.eigh(dense_laplacian(problem, problem.rotations))[1][:, :3]
    _, found = laplacian_rotations(problem)
    assert found.error <= PRECISE
    np.testing.assert_allclose(np.linalg.svd(reference.T @ found.vectors)[1], 1, atol=1e-12)


@EVERY_GRAPH
def test_eigenvectors_of_any_laplacian_agree_with_a_dense_eigensolver(edges: Ints) -> None:
    problem, _ = simulated(edges, noise_deg=10, seed=2)
    blocks = np.linalg.qr(np.random.default_rng(3).standard_normal((problem.m, 4, 4)))[0]
    laplacian = block_laplacian(problem, blocks)
    dense = dense_laplacian(problem, blocks)
    np.testing.assert_allclose(laplacian.toarray(), dense, atol=1e-12)
    start = np.random.default_rng(4).standard_normal((4 * problem.n, 2))
    found = smallest(laplacian, start)
    reference = np.linalg.eigh(dense)[1][:, :2]
    np.testing.assert_allclose(np.linalg.svd(reference.T @ found.vectors)[1], 1, atol=1e-10)


def test_quaternions_solve_the_homogeneous_system_of_scipy() -> None:
    """The singular vector of the stacked equations, quaternion products done by scipy."""
    from scipy.spatial.transform import Rotation

    problem, truth = simulated(SMALL, noise_deg=3)
    i, j = problem.edges.T
    measured = Rotation.from_matrix(problem.rotations).as_quat()
    cameras = Rotation.from_matrix(truth).as_quat()
    x, y, z, w = measured.T
    from_left = np.stack([[w, -z, y, x], [z, w, -x, y], [-y, x, w, z], [-x, -y, -z, w]]).transpose(2, 0, 1)
    fit = np.einsum("ea,eab,eb->e", cameras[i], from_left, cameras[j])
    signed = np.sign(fit)[:, None, None] * from_left
    solution = np.linalg.eigh(dense_laplacian(problem, signed))[1][:, 0].reshape(-1, 4)
    reference = Rotation.from_quat(solution).as_matrix()
    estimate = Quaternion().solve(problem, RNG)
    assert errors_deg(estimate.rotations, reference).max() < 1e-6


def test_sweeps_lower_the_sum_and_change_no_sign_at_the_end() -> None:
    problem, _ = simulated(RANDOM, noise_deg=15, outliers=0.3)
    costs = [Quaternion(sweeps=sweeps).solve(problem, RNG).cost for sweeps in (1, 50)]
    assert costs[1] < costs[0]  # type: ignore[operator]
    estimate = Quaternion().solve(problem, RNG)
    assert estimate.stop_reason == "no sign changes"
    assert Quaternion(sweeps=1).solve(problem, RNG).stop_reason == "sweep limit"


def test_signs_do_not_depend_on_the_start_where_there_are_no_outliers() -> None:
    problem, _ = simulated(RANDOM, noise_deg=5)
    tree, random = (Quaternion(init=init).solve(problem, RNG) for init in ("spanning-tree", "random"))  # type: ignore[arg-type]
    assert errors_deg(tree.rotations, random.rotations).max() < 1e-5


@pytest.mark.real_data
def test_ellis_island(real_data: Path) -> None:
    from bench.datasets.one_dsfm import OneDSfM

    sources = OneDSfM(scene="Ellis_Island").sources(real_data / "1dsfm", 0)
    instance = next(iter(sources)).load()  # type: ignore[union-attr]
    assert instance.truth is not None
    problem = instance.problem
    found, eigenspace = laplacian_rotations(problem)
    assert 2.5 < np.median(errors_deg(found, instance.truth)) < 3.0
    reference = np.linalg.eigh(block_laplacian(problem, problem.rotations).toarray())[1][:, :3]
    np.testing.assert_allclose(np.linalg.svd(reference.T @ eigenspace.vectors)[1], 1, atol=1e-12)
    blocks = reference.reshape(-1, 3, 3)
    oriented = so3.project(blocks * np.array([1, 1, np.sign(np.sign(np.linalg.det(blocks)).sum())]))
    assert errors_deg(found, oriented).max() < 1e-4
