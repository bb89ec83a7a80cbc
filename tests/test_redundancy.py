"""Which edges nothing checks: against removing them one by one, and in the words of a reader."""

import numpy as np
import pytest
from graphs import grid_edges, random_edges
from numpy.typing import NDArray

from bench.core import redundancy
from bench.core.problem import Problem
from bench.core.redundancy import in_no_loop, in_no_triangle, loops_told, triangles_told


def graph(edges: NDArray[np.int32] | list[list[int]], n: int | None = None) -> Problem:
    edges = np.array(edges)
    return Problem(int(edges.max()) + 1 if n is None else n, edges, np.tile(np.eye(3), (len(edges), 1, 1)))


def components(problem: Problem, without: int) -> int:
    kept = np.delete(problem.edges, without, axis=0)
    return int(graph(kept, problem.n).components.max()) if len(kept) else problem.n - 1


def test_bridges_are_the_edges_whose_removal_parts_the_graph() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        edges = random_edges(25, 0.03, seed)
        edges = edges[rng.random(len(edges)) < 0.9]  # several components
        edges = np.concatenate([edges, edges[rng.integers(0, len(edges), 3)]])  # pairs measured twice
        problem = graph(edges, 25)
        whole = int(problem.components.max())
        wanted = [components(problem, k) > whole for k in range(problem.m)]
        np.testing.assert_array_equal(in_no_loop(problem), wanted)


@pytest.mark.parametrize("as_bits", [True, False])
def test_triangles_are_found_by_their_third_camera(as_bits: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not as_bits:
        monkeypatch.setattr(redundancy, "_BITSETS", 0)
    for seed in range(10):
        problem = graph(np.concatenate([random_edges(70, 0.04, seed), [[0, 1], [3, 4]]]))
        near = problem.adjacency().toarray() > 0
        wanted = [not (near[i] & near[j]).any() for i, j in problem.edges]
        assert 0 < sum(wanted) < problem.m
        np.testing.assert_array_equal(in_no_triangle(problem), wanted)


def test_a_long_chain_and_a_long_ring() -> None:
    n = 50_000
    chain = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    assert in_no_loop(graph(chain)).all()
    assert not in_no_loop(graph(np.concatenate([chain, [[0, n - 1]]]))).any()
    assert in_no_triangle(graph(chain)).all()


def test_words() -> None:
    tree = graph([[k, k + 1] for k in range(7)])
    assert (loops_told(tree) or "").startswith("the graph is a tree: 0 of 7 edges lie in a loop")
    assert (loops_told(graph([[0, 1], [2, 3]])) or "").startswith("the graph is a forest: 0 of 2 edges")
    lollipop = graph([[0, 1], [1, 2], [0, 2], [2, 3], [3, 4]])
    assert loops_told(lollipop) == "2 of 5 edges lie in no loop (bridges): nothing checks them"
    assert triangles_told(lollipop) == "2 of 5 edges in no triangle"
    assert loops_told(graph([[0, 1], [0, 1]])) is None
    grid = graph(grid_edges(4, 5))
    assert (loops_told(grid), triangles_told(grid)) == (None, "31 of 31 edges in no triangle")
    assert triangles_told(graph([[0, 1], [0, 2], [1, 2]])) is None
