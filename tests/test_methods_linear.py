"""Spanning trees and spectral synchronization: where they are exact, and what they are invariant to."""

from collections.abc import Callable

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated, transformed
from scipy import sparse

from bench.core import so3
from bench.core.problem import Floats, Ints, Problem
from bench.methods._lib.graph.trees import tree_edges
from bench.methods._lib.linear import eigen
from bench.methods._lib.linear.eigen import leading
from bench.methods._lib.linear.spectral import spectral_rotations
from bench.methods.martinec_pajdla import MartinecPajdla
from bench.methods.spanning_tree import SpanningTree
from bench.methods.spectral import Spectral

RNG = np.random.default_rng(0)  # the methods here draw nothing from it
COMPLETE = random_edges(120, 1.0)
RANDOM = random_edges(150, 0.15)
GRID = grid_edges(6, 30)
RING = np.array([[k, k + 1] for k in range(299)] + [[0, 299]], dtype=np.int32)
SMALL = random_edges(20, 0.3)
EVERY_GRAPH = pytest.mark.parametrize(
    "edges", [SMALL, RANDOM, COMPLETE, GRID, RING], ids=["small", "random", "complete", "grid", "ring"]
)


def weighted(problem: Problem, weights: Floats) -> Problem:
    return Problem(problem.n, problem.edges, problem.rotations, weights)


@EVERY_GRAPH
@pytest.mark.parametrize("method", [SpanningTree(), Spectral(), Spectral(normalised=False)], ids=str)
def test_noise_free_problems_are_solved_exactly(method: Spectral | SpanningTree, edges: Ints) -> None:
    problem, truth = simulated(edges)
    assert errors_deg(method.solve(problem, RNG).rotations, truth).max() < 1e-8


@EVERY_GRAPH
@pytest.mark.parametrize("method", [SpanningTree(), Spectral(), Spectral(normalised=False)], ids=str)
def test_labels_and_edge_order_do_not_matter(method: Spectral | SpanningTree, edges: Ints) -> None:
    problem, _ = simulated(edges, noise_deg=5, outliers=0.1)
    other, order = transformed(problem)
    first, second = method.solve(problem, RNG).rotations, method.solve(other, RNG).rotations
    assert errors_deg(second, first[order]).max() < 1e-6


def test_a_breadth_first_tree_has_shortest_paths_from_the_hub() -> None:
    edges = np.array([[0, 1], [0, 2], [0, 3], [1, 4], [2, 4], [2, 5], [4, 6]], dtype=np.int32)
    problem, _ = simulated(edges, noise_deg=5)
    # Camera 4 hangs from 2 (three edges), not from 1 (two edges): edge 3 is left out. Hubs 0, 2 and 4 tie.
    trees = {0: [0, 1, 2, 4, 5, 6], 2: [0, 1, 2, 4, 5, 6], 4: [1, 2, 3, 4, 5, 6]}
    angles = so3.angle(problem.rotations)
    hub = min(trees, key=lambda camera: angles[(edges == camera).any(axis=1)].sum())
    assert sorted(tree_edges(problem, None)) == trees[hub]


def test_a_tree_fits_its_own_edges() -> None:
    problem, _ = simulated(RANDOM, noise_deg=5, outliers=0.3)
    estimate = SpanningTree().solve(problem, RNG)
    assert estimate.edge_weights is not None
    chosen = estimate.edge_weights == 1
    residuals = problem.residuals(estimate.rotations)
    assert chosen.sum() == problem.n - 1
    assert residuals[chosen].max() < 1e-12
    assert residuals[~chosen].max() > 0.1


def test_weights_choose_the_heaviest_tree() -> None:
    edges = np.array([[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]], dtype=np.int32)
    problem, _ = simulated(edges, noise_deg=5)
    assert sorted(tree_edges(problem, np.array([5.0, 1.0, 4.0, 2.0, 3.0]))) == [0, 2, 4]


def test_equal_weights_leave_the_tree_independent_of_labels() -> None:
    problem, _ = simulated(RANDOM, noise_deg=5)
    problem = weighted(problem, np.random.default_rng(1).integers(1, 4, problem.m).astype(float))
    other, order = transformed(problem)
    first, second = SpanningTree().solve(problem, RNG).rotations, SpanningTree().solve(other, RNG).rotations
    assert errors_deg(second, first[order]).max() < 1e-6


@pytest.mark.parametrize("normalised", [True, False])
@EVERY_GRAPH
def test_spectral_agrees_with_a_dense_eigensolver(edges: Ints, normalised: bool) -> None:
    problem, _ = simulated(edges, noise_deg=10, outliers=0.05, seed=2)
    matrix = problem.block_matrix(diagonal=np.ones(problem.n)).toarray()
    if normalised:
        scale = np.repeat((problem.degree + 1.0) ** -0.5, 3)
        matrix *= scale[:, None] * scale
    reference = np.linalg.eigh(matrix)[1][:, -3:]
    found = spectral_rotations(problem, normalised=normalised)[1].vectors
    np.testing.assert_allclose(np.linalg.svd(reference.T @ found)[1], 1, atol=1e-12)


@pytest.mark.parametrize("edges", [SMALL, RANDOM, GRID], ids=["small", "random", "grid"])
def test_edge_weights_silence_outliers(edges: Ints) -> None:
    problem, truth = simulated(edges)
    rotations = np.array(problem.rotations)
    weights = np.full(problem.m, 7.0)
    weights[1::5] = 1e-9
    weights[edges[:, 1] == edges[:, 0] + 1] = 7.0
    rotations[weights < 1] = so3.random(np.random.default_rng(4), int((weights < 1).sum()))
    corrupted = Problem(problem.n, edges, rotations)
    assert errors_deg(spectral_rotations(corrupted, weights)[0], truth).max() < 1e-4
    assert errors_deg(spectral_rotations(corrupted)[0], truth).max() > 1


def test_the_eigensolver_finds_a_triple_eigenvalue_and_says_how_well() -> None:
    start = np.random.default_rng(0).standard_normal((400, 3))
    triple = np.concatenate([np.linspace(-1, 0.9, 397), np.ones(3)])[:, None]
    found = leading(lambda x: triple * x, start, 1e-9)
    assert found.error <= 1e-9
    assert np.abs(found.vectors[:397]).max() < 1e-8
    stopped = leading(lambda x: triple * x, start, 1e-9, most_products=3)
    assert stopped.products == 3
    assert stopped.error > 1e-3


# --- eigenvalues that coincide -----------------------------------------------------------------------


def star(leaves: int) -> Ints:
    return np.array([[0, k] for k in range(1, leaves + 1)], dtype=np.int32)


def ring(n: int) -> Ints:
    return np.array([[0, n - 1], *([k, k + 1] for k in range(n - 1))], dtype=np.int32)


@pytest.mark.parametrize("noise_deg", [0.0, 5.0])
@pytest.mark.parametrize("method", [Spectral(), Spectral(normalised=False), MartinecPajdla()], ids=str)
def test_stars_are_solved_whatever_the_number_of_cameras(method: Spectral | MartinecPajdla, noise_deg: float) -> None:
    """Nothing contradicts the measurements of a tree: its solution fits them all. Most eigenvalues coincide."""
    for leaves in (*range(2, 60), 99, 100, 130):
        problem, _ = simulated(star(leaves), noise_deg=noise_deg, seed=leaves)
        rotations = method.solve(problem, RNG).rotations
        assert np.degrees(problem.residuals(rotations)).max() < 1e-5, leaves


@pytest.mark.parametrize("graph", [ring, lambda n: random_edges(n, 1.0)], ids=["ring", "complete"])
def test_rings_and_complete_graphs_of_any_size_are_solved(graph: Callable[[int], Ints]) -> None:
    for n in (*range(3, 40), 100, 101):
        problem, truth = simulated(graph(n), seed=n)
        for method in (Spectral(), Spectral(normalised=False), MartinecPajdla()):
            assert errors_deg(method.solve(problem, RNG).rotations, truth).max() < 1e-6, (n, method)


@pytest.mark.parametrize("method", [Spectral(), Spectral(normalised=False), MartinecPajdla()], ids=str)
@pytest.mark.parametrize("edges", [random_edges(120, 1.0), star(120), ring(120)], ids=["complete", "star", "ring"])
def test_cameras_that_are_all_alike_are_no_harder(method: Spectral | MartinecPajdla, edges: Ints) -> None:
    """Where all measurements are the identity rounding is alike too, and stays in the space that is searched."""
    problem = Problem(int(edges.max()) + 1, edges, np.tile(np.eye(3), (len(edges), 1, 1)))
    estimate = method.solve(problem, RNG)
    assert problem.residuals(estimate.rotations).max() < 1e-9
    assert estimate.stop_reason == "eigenvectors converged"
    assert estimate.iterations is not None
    assert estimate.iterations < 20


@pytest.mark.parametrize("multiplicities", [[3, 27], [27, 3], [1] * 30, [3, 1, 22, 4], [10, 10, 10], [2, 2, 26], [30]])
def test_every_eigenpair_asked_for_comes_whatever_the_multiplicities(multiplicities: list[int]) -> None:
    rng = np.random.default_rng(0)
    values = np.repeat(np.arange(len(multiplicities)) - 1.5, multiplicities)
    for size in (30, 330):  # LAPACK, and iterations
        spectrum = np.sort(np.tile(values, size // 30))
        basis = np.linalg.qr(rng.standard_normal((size, size)))[0]
        matrix = (basis * spectrum) @ basis.T
        positive = matrix + 3 * np.eye(size)
        for count in (3, 4):
            start = rng.standard_normal((size, count))
            low = eigen.smallest(sparse.bsr_array(positive, blocksize=(3, 3)), start)
            high = eigen.leading_of_dense(matrix, count) if size == 30 else leading(lambda x, a=matrix: a @ x, start)
            for found, wanted, scaled in (
                (low, spectrum[:count] + 3, positive),
                (high, spectrum[-count:], matrix),
            ):
                np.testing.assert_allclose(found.values, wanted, atol=1e-9)
                np.testing.assert_allclose(found.vectors.T @ found.vectors, np.eye(count), atol=1e-10)
                np.testing.assert_allclose(scaled @ found.vectors, found.vectors * found.values, atol=1e-4)


def test_degrees_are_divided_out_unless_one_asks_otherwise() -> None:
    """Along a trajectory that hangs on a clique the plain eigenvectors sink below rounding; the default's do not."""
    trajectory = [[k, k + 1] for k in range(19, 60)]
    edges = np.concatenate([random_edges(20, 1.0), np.array(trajectory, dtype=np.int32)])
    problem, truth = simulated(edges)
    assert errors_deg(Spectral().solve(problem, RNG).rotations, truth).max() < 1e-6
    assert errors_deg(Spectral(normalised=False).solve(problem, RNG).rotations, truth).max() > 10
