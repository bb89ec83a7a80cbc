"""The graphs that NeuRoRA was trained on: what its script makes of them."""

import numpy as np
import pytest

from bench import Instance, so3
from bench.datasets.neurora_graphs import NeuRoRAGraphs


def made(fewest: int, most: int, seed: int) -> Instance:
    (source,) = NeuRoRAGraphs(fewest, most).sources(None, seed)
    return source.load()


def errors(graph: Instance) -> np.ndarray:
    """(m, 3) rotation vectors c in R_j R_i^T exp(c), degrees."""
    assert graph.truth is not None
    i, j = graph.problem.edges.T
    true = graph.truth[j] @ np.swapaxes(graph.truth[i], 1, 2)
    return np.degrees(so3.log(np.swapaxes(true, 1, 2) @ np.swapaxes(graph.problem.rotations, 1, 2)))


def test_a_seed_makes_one_graph_and_another_another() -> None:
    a, b, c = made(50, 60, 0), made(50, 60, 0), made(50, 60, 1)
    np.testing.assert_array_equal(a.problem.rotations, b.problem.rotations)
    assert a.problem.m != c.problem.m
    assert all(50 <= made(50, 60, seed).problem.n <= 60 for seed in range(10))


def test_graphs_have_the_size_and_the_share_of_edges_of_the_published_set() -> None:
    graph = made(400, 1000, 0)
    n, edges = graph.problem.n, graph.problem.edges
    assert 400 <= n <= 1000
    assert np.all(edges[:, 1] <= 2 * edges[:, 0] + 5)
    candidates = sum(min(n - 1, 2 * i + 5) - i for i in range(n))
    assert len(edges) / candidates <= 0.5
    assert graph.problem.components.max() == 0


def test_edges_join_cameras_that_look_alike_but_for_a_tree() -> None:
    for seed in range(5):
        graph = made(100, 150, seed)
        assert graph.truth is not None
        i, j = graph.problem.edges.T
        angles = np.degrees(so3.angle_between(graph.truth[i], graph.truth[j]))
        assert np.sum(angles > 60) < graph.problem.n


def test_cameras_are_sorted_by_pan() -> None:
    graph = made(200, 200, 0)
    assert graph.truth is not None
    pans = so3.log(graph.truth)[:, 1]
    assert np.corrcoef(pans, np.arange(200))[0, 1] > 0.9


def test_noise_lies_in_the_image_plane_and_outliers_anywhere() -> None:
    graph = made(300, 300, 0)
    error, wrong = errors(graph), graph.outliers
    assert wrong is not None
    np.testing.assert_array_equal(np.linalg.norm(error, axis=1) > 20, wrong)
    assert 0.1 < np.mean(wrong) < 0.4
    spread = np.median(np.abs(error[~wrong]), axis=0)
    assert spread[2] < 0.3 * min(spread[:2])
    assert np.median(np.abs(error[np.linalg.norm(error, axis=1) > 60, 2])) > 10


def test_three_cameras_are_the_fewest() -> None:
    assert made(3, 3, 0).problem.n == 3
    with pytest.raises(ValueError, match=r"fewest=9 is more than most=8"):
        NeuRoRAGraphs(9, 8)
