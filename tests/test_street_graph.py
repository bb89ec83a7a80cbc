"""View graphs of streets and squares made from nothing."""

import numpy as np
import pytest
from scenes import load, the_source

from bench.core.problem import Floats, Ints, Problem
from bench.datasets._simulated.streets import Street
from bench.datasets.street_graph import StreetGraph


def degrees(edges: Ints, n: int) -> Ints:
    return np.bincount(edges.ravel(), minlength=n)


@pytest.mark.parametrize("closed", [False, True])
def test_topologies_are_like_those_of_view_graphs(closed: bool) -> None:
    """Ranges of the sixteen at hand: tenth, median and ninth decile of the degree over its mean, and transitivity."""
    n = 1500
    for seed in range(3):
        rng = np.random.default_rng(seed)
        edges = Street.drawn(100, closed, rng).edges(n, rng)
        found = degrees(edges, n)
        assert found.min() >= 1
        assert found.mean() == pytest.approx(100, rel=0.2)
        low, middle, high = np.quantile(found, [0.1, 0.5, 0.9]) / found.mean()
        assert low < 0.4
        assert 0.4 < middle < 1.4
        assert 1.2 < high < 3.0
        neighbours = {tuple(edge) for edge in edges.tolist()}
        center = rng.choice(n, 2000, p=found * (found - 1) / (found * (found - 1)).sum())
        around = [np.flatnonzero((edges == c).any(axis=1)) for c in center[:200]]
        ends = [edges[at].sum(axis=1) - c for at, c in zip(around, center, strict=False)]
        joined = [tuple(sorted(rng.choice(at, 2, replace=False).tolist())) in neighbours for at in ends]
        assert 0.4 < np.mean(joined) < 0.95


@pytest.mark.parametrize(("n", "degree"), [(2, 2.0), (3, 60.0), (50, 2.0), (60, 40.0)])
@pytest.mark.parametrize("layout", ["street", "square"])
def test_graphs_of_every_size_are_simple_and_connected(n: int, degree: float, layout: str) -> None:
    for seed in range(3):
        instance = load(StreetGraph(n, degree, layout), seed=seed)  # type: ignore[arg-type]
        assert not instance.problem.components.any()
        assert not instance.problem.has_parallel_edges
        assert instance.problem.edges.max() == n - 1


def test_a_square_closes_and_a_street_does_not() -> None:
    """The second eigenvalue of the Laplacian of a ring is four times that of a line."""
    line, ring = (
        eigenvalues(Street(30, closed=closed, hard=0, clumps=0).edges(400, np.random.default_rng(1)))
        for closed in (False, True)
    )
    assert ring[1] > 2 * line[1]


def eigenvalues(edges: Ints) -> Floats:
    problem = Problem(400, edges, np.tile(np.eye(3), (len(edges), 1, 1)))
    return np.linalg.eigvalsh(problem.laplacian().toarray())


def test_seed_and_parameters_decide() -> None:
    one, same, other = (load(StreetGraph(40, 10.0), seed=seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one.problem.rotations, same.problem.rotations)
    assert one.problem.m != other.problem.m or (one.problem.edges != other.problem.edges).any()
    assert one.name == "street-n40-degree10"
    assert the_source(StreetGraph(40, 10.0, "square", 3.0, 0.1)).name == "square-n40-degree10-noise3.0-outliers0.1"
    given = load(StreetGraph(300, 60.0, noise_deg=3.0, outliers=0.1))
    assert given.truth is not None
    errors = np.degrees(given.problem.residuals(given.truth))
    assert np.median(errors) == pytest.approx(3.0, rel=0.3)
