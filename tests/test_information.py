"""What comes with measurements: weights, precisions, gravity; parallel edges; how it travels with the edges."""

import numpy as np
import pytest

from bench import InputError, Problem, so3
from bench.core.fusion import fused
from bench.core.problem import reoriented

RNG = np.random.default_rng(0)


def exact(n: int, edges: list[tuple[int, int]]) -> tuple[Problem, np.ndarray]:
    truth = so3.random(RNG, n)
    i, j = np.array(edges).T
    return Problem(n, np.array(edges), truth[i] @ np.swapaxes(truth[j], -1, -2)), truth


def spd(count: int) -> np.ndarray:
    root = RNG.normal(size=(count, 3, 3))
    return root @ np.swapaxes(root, -1, -2) + np.eye(3)


def test_a_reversed_edge_keeps_its_cost() -> None:
    """d^T P d of a measurement is the same read from either end."""
    problem, truth = exact(2, [(0, 1)])
    d, precision = 0.01 * RNG.normal(size=3), spd(1)
    measured = so3.exp(d[None]) @ problem.rotations
    edges, rotations, turned = reoriented(np.array([[1, 0]]), np.swapaxes(measured, -1, -2), precision)
    assert edges.tolist() == [[0, 1]]
    np.testing.assert_allclose(rotations, measured, atol=1e-15)
    assert turned is not None
    d_flipped = so3.log(np.swapaxes(measured, -1, -2) @ (truth[0] @ truth[1].T))[0]
    np.testing.assert_allclose(d @ turned[0] @ d, d_flipped @ precision[0] @ d_flipped, rtol=1e-9)


def test_subgraphs_keep_what_came_with_the_measurements() -> None:
    problem, _ = exact(4, [(0, 1), (1, 2), (2, 3), (0, 3)])
    gravity = RNG.normal(size=(4, 3))
    gravity[1] = np.nan
    weights = np.array([1.0, 2, 3, 4])
    full = Problem(4, problem.edges, problem.rotations, weights, "count", spd(4), gravity)
    part, kept = full.subgraph(np.array([3, 2, 1]))
    assert part.weights_kind == "count"
    assert part.weights is not None
    assert part.weights.tolist() == weights[kept].tolist()
    again, _ = part.subgraph(np.array([2, 1, 0]))
    straight, _ = full.subgraph(np.array([1, 2, 3]))
    np.testing.assert_allclose(again.precisions, straight.precisions, atol=1e-9)
    np.testing.assert_array_equal(again.gravity, straight.gravity)
    assert full.carries == {"weights", "precisions", "gravity"}
    assert full.keeping(["gravity"]).carries == {"gravity"}
    assert full.keeping(full.carries) is full


@pytest.mark.parametrize(
    ("field", "value", "what"),
    [
        ("precisions", np.zeros((1, 3, 3)), "precision of edge 0"),
        ("precisions", np.array([[[1.0, 1, 0], [0, 1, 0], [0, 0, 1]]]), "symmetric"),
        ("precisions", -np.eye(3)[None], "positive"),
        ("precisions", np.full((1, 3, 3), np.nan), "finite"),
        ("precisions", np.eye(3), r"shape \(1, 3, 3\)"),
        ("gravity", np.zeros((2, 3)), "gravity of camera 0"),
        ("gravity", [[0, 0, np.inf]] * 2, "gravity of camera 0"),
        ("gravity", np.ones((1, 3)), r"shape \(2, 3\)"),
        ("weights", [0.0], "weight of edge 0"),
        ("weights_kind", "matches", "'count' or 'precision'"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(field: str, value: object, what: str) -> None:
    with pytest.raises(InputError, match=what):
        Problem(2, np.array([[0, 1]]), np.eye(3)[None], **{field: value})


class TestFusion:
    def test_a_simple_graph_stays_as_it_is(self) -> None:
        problem, _ = exact(4, [(0, 1), (1, 2), (0, 3)])
        assert not problem.has_parallel_edges
        simple, pair = fused(problem)
        order = np.argsort(pair)
        np.testing.assert_array_equal(simple.edges, problem.edges[order])
        np.testing.assert_allclose(simple.rotations, problem.rotations[order], atol=1e-14)

    def test_one_wrong_of_three_does_not_move_the_median(self) -> None:
        problem, _ = exact(2, [(0, 1)])
        right = problem.rotations[0]
        parallel = Problem(
            2, np.tile([[0, 1]], (3, 1)), np.stack([right, so3.exp(np.array([0.0, 2, 0])) @ right, right]), [1, 2.5, 2]
        )
        assert parallel.has_parallel_edges
        simple, pair = fused(parallel)
        assert pair.tolist() == [0, 0, 0]
        assert simple.weights is not None
        assert simple.weights.tolist() == [5.5]
        assert so3.angle_between(simple.rotations, right[None])[0] < 1e-9

    def test_two_of_one_weight_meet_in_the_middle_and_precisions_add(self) -> None:
        turn = so3.exp(np.array([0.2, 0, 0]))
        both = Problem(2, [[0, 1], [0, 1]], np.stack([np.eye(3), turn]), None, "precision", np.stack([np.eye(3)] * 2))
        simple, _ = fused(both)
        assert so3.angle_between(simple.rotations, so3.exp(np.array([[0.1, 0, 0]])))[0] < 1e-12
        np.testing.assert_allclose(simple.precisions, [2 * np.eye(3)])
