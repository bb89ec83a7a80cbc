"""The problem contract: validation in one sentence, views, read-only."""

import numpy as np
import pytest

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Problem, oriented

EYE = np.eye(3)


def ring(n: int = 5) -> tuple[Problem, np.ndarray]:
    truth = so3.random(np.random.default_rng(0), n)
    edges = np.array([*((i, i + 1) for i in range(n - 1)), (0, n - 1)])
    i, j = edges.T
    return Problem(n, edges, truth[i] @ np.swapaxes(truth[j], -1, -2)), truth


@pytest.mark.parametrize(
    ("n", "edges", "rotations", "sentence"),
    [
        (0, [], [], "the graph has no cameras"),
        (2, np.empty((0, 2)), np.empty((0, 3, 3)), "the graph has no edges"),
        (2, [[0, 1, 2]], [EYE], r"edges must have shape \(m, 2\)"),
        (2, [[0, 2]], [EYE], r"edge 0 is \(0, 2\), but camera ids go from 0 to 1"),
        (2, [[-1, 1]], [EYE], r"camera ids go from 0 to 1"),
        (2, [[1, 1]], [EYE], "a camera with itself"),
        (2, [[1, 0]], [EYE], "edges must have i < j"),
        (2, [[0, 1]], [EYE, EYE], r"rotations must have shape \(1, 3, 3\)"),
        (2, [[0, 1]], [np.nan * EYE], r"the rotation of edge 0 \(0, 1\) is not finite"),
        (2, [[0, 1]], [-EYE], r"has determinant -1, but a rotation has \+1"),
    ],
)
def test_what_is_wrong_is_said(n: int, edges: object, rotations: object, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        Problem(n, np.array(edges), np.array(rotations))


@pytest.mark.parametrize("weight", [0.0, -1.0, np.nan, np.inf])
def test_weights_are_positive(weight: float) -> None:
    with pytest.raises(InputError, match="not a positive number"):
        Problem(2, np.array([[0, 1]]), EYE[None], np.array([weight]))


def test_almost_rotations_are_projected_and_counted() -> None:
    rotations = np.stack([EYE, EYE + 1e-4])
    with pytest.warns(UserWarning, match="1 of 2 relative rotations were not in SO"):
        problem = Problem(3, np.array([[0, 1], [1, 2]]), rotations)
    np.testing.assert_allclose(problem.rotations[1] @ problem.rotations[1].T, EYE, atol=1e-14)


def test_arrays_are_copies_and_read_only() -> None:
    edges, rotations = np.array([[0, 1]]), EYE[None].copy()
    problem = Problem(2, edges, rotations)
    rotations[0] = 0
    assert problem.rotations[0, 0, 0] == 1
    for array in (problem.edges, problem.rotations):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_the_truth_has_no_residual_and_the_convention_is_as_written() -> None:
    problem, truth = ring()
    np.testing.assert_allclose(problem.residuals(truth), 0, atol=1e-14)
    np.testing.assert_allclose(problem.residuals(truth @ so3.random(np.random.default_rng(1), 1)[0]), 0, atol=1e-14)
    assert problem.residuals(np.swapaxes(truth, -1, -2)).min() > 1e-2


def test_block_matrix_has_the_truth_as_eigenvectors() -> None:
    problem, truth = ring()
    stacked = truth.reshape(-1, 3)
    np.testing.assert_allclose(problem.block_matrix() @ stacked, 2 * stacked, atol=1e-13)
    weighted = problem.block_matrix(np.arange(1.0, 6.0), diagonal=np.full(5, 7.0)).toarray()
    np.testing.assert_allclose(weighted, weighted.T)
    np.testing.assert_allclose(weighted[3:6, 6:9], 2 * problem.rotations[1])
    np.testing.assert_allclose(weighted[:3, :3], 7 * EYE)


def test_laplacian_of_a_ring() -> None:
    problem, _ = ring()
    expected = 2 - 2 * np.cos(2 * np.pi * np.arange(5) / 5)
    np.testing.assert_allclose(np.linalg.eigvalsh(problem.laplacian().toarray()), np.sort(expected), atol=1e-12)
    assert problem.degree.tolist() == [2] * 5


def test_components_are_numbered_from_the_largest() -> None:
    problem = Problem(6, np.array([(0, 1), (2, 3), (3, 4)]), np.tile(EYE, (3, 1, 1)))
    assert problem.components.tolist() == [1, 1, 0, 0, 0, 2]


def test_subgraph_relabels_and_reverses() -> None:
    problem, truth = ring()
    order = np.array([3, 0, 4])
    part, kept = problem.subgraph(order)
    assert kept.tolist() == [False, False, False, True, True]
    np.testing.assert_allclose(part.residuals(truth[order]), 0, atol=1e-14)


def test_oriented_transposes_what_it_reverses() -> None:
    problem, _ = ring()
    reversed_rotations = np.swapaxes(problem.rotations, -1, -2)
    edges, rotations = oriented(problem.edges[:, ::-1], reversed_rotations)
    np.testing.assert_array_equal(edges, problem.edges)
    np.testing.assert_array_equal(rotations, problem.rotations)
