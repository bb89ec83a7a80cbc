"""HARA: its triangles against enumeration, its tree against the definition, and what it recovers."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated, transformed

from bench.core import so3
from bench.core.problem import Ints, Problem
from bench.methods._lib.graph.all_triangles import AllTriangles
from bench.methods._lib.graph.hierarchical_tree import chordal_l1_mean, hierarchical_tree, support_levels
from bench.methods.hara import HARA
from bench.methods.l1_irls import L1IRLS
from bench.methods.spanning_tree import SpanningTree
from bench.plugins.declare import Source

RNG = np.random.default_rng(0)  # the method draws nothing from it
DENSE = random_edges(60, 0.4)
GRAPHS = {
    "pair": np.array([[0, 1]], dtype=np.int32),
    "dense": DENSE,
    "sparse": random_edges(80, 0.05),
    "grid": grid_edges(5, 8),
}


def test_triangles_are_all_triangles_with_their_errors() -> None:
    problem, _ = simulated(random_edges(12, 0.5), outliers=0.5)
    found = AllTriangles.of(problem)
    measured = {(int(i), int(j)): r for (i, j), r in zip(problem.edges, problem.rotations, strict=True)}
    wanted = {}
    for i, j, k in itertools.combinations(range(12), 3):
        if {(i, j), (j, k), (i, k)} <= set(measured):
            wanted[i, j, k] = np.linalg.norm(measured[i, j] @ measured[j, k] - measured[i, k]) ** 2
    assert len(wanted) > 10
    cameras = [tuple(sorted(set(problem.edges[row].ravel().tolist()))) for row in found.edges]
    assert dict(zip(cameras, found.errors, strict=True)) == pytest.approx(wanted, abs=1e-5)
    closing = found.errors < 1
    for edge, support in enumerate(found.support(closing, problem.m)):
        i, j = problem.edges[edge]
        around = [error for triangle, error in wanted.items() if {i, j} <= set(triangle)]
        assert support == sum(error < 1 for error in around)
        assert found.mean_distance(problem.m)[edge] == pytest.approx(
            np.mean(np.sqrt(around)) if around else 0, abs=1e-5
        )


def test_levels_put_support_before_thresholds() -> None:
    complete = random_edges(4, 1.0)
    problem, _ = simulated(complete)
    bad = np.flatnonzero((complete == [0, 1]).all(axis=1))
    rotations = problem.rotations.copy()
    rotations[bad] = so3.exp(np.array([0.3, 0.0, 0.0])) @ rotations[bad]
    triangles = AllTriangles.of(Problem(4, complete, rotations))
    levels = support_levels(problem, triangles, np.array([1e-6, 1.0]), most=2)
    for (i, j), level in zip(complete.tolist(), levels, strict=True):
        # Triangles 012 and 013 close at the loose threshold only, 023 and 123 at both.
        wanted = 1 if (i, j) == (0, 1) else 0 if (i, j) == (2, 3) else 1
        assert level == wanted


def test_the_tree_prefers_supported_edges() -> None:
    """Two groups joined by edges of which one is wrong: no triangle supports it."""
    problem, truth = simulated(random_edges(20, 0.7), outliers=0.3)
    triangles = AllTriangles.of(problem)
    levels = support_levels(problem, triangles, np.array([1e-6]), most=10)
    tree = hierarchical_tree(problem, levels, 10)
    assert errors_deg(tree.rotations, truth).max() < 1e-4
    assert errors_deg(SpanningTree().solve(problem, RNG).rotations, truth).max() > 10


def test_the_average_withstands_a_minority() -> None:
    rng = np.random.default_rng(1)
    middle = so3.random(rng, 1)[0]
    members = np.concatenate([middle @ so3.exp(1e-4 * rng.standard_normal((7, 3))), so3.random(rng, 3)])
    assert np.degrees(so3.angle_between(chordal_l1_mean(members), middle)) < 0.1
    np.testing.assert_allclose(chordal_l1_mean(middle[None]), middle, atol=1e-9)


@pytest.mark.parametrize("edges", GRAPHS.values(), ids=GRAPHS)
def test_noise_free_problems_are_solved_exactly(edges: Ints) -> None:
    problem, truth = simulated(edges)
    estimate = HARA().solve(problem, RNG)
    assert errors_deg(estimate.rotations, truth).max() < 1e-6


def test_outliers_are_filtered() -> None:
    problem, truth = simulated(DENSE, noise_deg=2, outliers=0.15)
    estimate = HARA().solve(problem, RNG)
    assert errors_deg(estimate.rotations, truth).mean() < 1
    assert estimate.edge_weights is not None
    true_residuals = problem.residuals(truth)
    removed = estimate.edge_weights == 0
    assert removed[true_residuals > np.radians(60)].all()
    assert not removed[true_residuals < np.radians(20)].any()


def test_many_outliers_turn_the_filter_off() -> None:
    problem, truth = simulated(DENSE, noise_deg=2, outliers=0.4)
    estimate = HARA().solve(problem, RNG)
    assert "no edge was filtered: most triangles are far from closing" in estimate.notes
    assert errors_deg(estimate.rotations, truth).mean() < 1.5


def test_without_a_filter_it_ends_where_l1_irls_does() -> None:
    problem, _ = simulated(DENSE, noise_deg=3, outliers=0.2)
    found = HARA(filter_deg=180, tolerance_deg=1e-4).solve(problem, RNG)
    wanted = L1IRLS(loss="l-half", tolerance_deg=1e-4, irls_iterations=500).solve(problem, RNG)
    assert errors_deg(found.rotations, wanted.rotations).mean() < 0.2


def test_labels_and_edge_order_do_not_matter() -> None:
    problem, _ = simulated(random_edges(50, 0.15), noise_deg=3, outliers=0.2)
    other, order = transformed(problem)
    first, second = HARA().solve(problem, RNG).rotations, HARA().solve(other, RNG).rotations
    assert errors_deg(second, first[order]).max() < 1e-6


def test_a_graph_without_triangles_is_averaged_and_says_so() -> None:
    problem, truth = simulated(grid_edges(4, 6), noise_deg=2)
    estimate = HARA().solve(problem, RNG)
    assert "cameras averaged for want of triplet support: 23" in estimate.notes
    assert errors_deg(estimate.rotations, truth).max() < 15


def test_the_filter_never_disconnects() -> None:
    """A camera held by two edges that contradict each other, in no triangle, keeps one of them."""
    clique = random_edges(8, 1.0)
    edges = np.concatenate([clique, [[0, 8], [7, 8]]]).astype(np.int32)
    edges = edges[~((edges == [0, 7]).all(axis=1))]
    problem, truth = simulated(edges)
    rotations = problem.rotations.copy()
    rotations[-1] = so3.exp(np.array([2.5, 0.0, 0.0])) @ rotations[-1]
    estimate = HARA(irls_iterations=5).solve(Problem(9, edges, rotations), RNG)
    assert errors_deg(estimate.rotations, truth)[:8].max() < 1e-3
    assert np.isfinite(estimate.rotations).all()


@pytest.mark.real_data
def test_ellis_island(real_data: Path) -> None:
    """Published on the whole component: 2.1 mean, 2.6 without refinement, 2.5 without the filter."""
    from bench.datasets.one_dsfm import OneDSfM

    source = next(iter(OneDSfM(scene="Ellis_Island", protocol="component").sources(real_data / "1dsfm", 0)))
    assert isinstance(source, Source)
    instance = source.load()
    assert instance.truth is not None
    known = np.isfinite(instance.truth).all(axis=(1, 2))
    for method, most in ((HARA(), 2.1), (HARA(irls_iterations=0), 2.9), (HARA(filter_deg=180), 2.6)):
        rotations = method.solve(instance.problem, RNG).rotations
        assert errors_deg(rotations[known], instance.truth[known]).mean() < most
