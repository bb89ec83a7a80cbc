"""Simulated trajectories: which poses are measured against each other, how well, and what is wrong."""

import numpy as np
import pytest

from bench import Instance
from bench.datasets.trajectory import Layout, Trajectory


def made(layout: Layout = "spiral", seed: int = 0, wrong: float = 0.1, n: int = 100) -> Instance:
    (source,) = Trajectory(n, layout, noise_deg=1.5, wrong=wrong).sources(None, seed)
    return source.load()


@pytest.mark.parametrize(("layout", "degree"), [("spiral", 3.78), ("torus", 4.0), ("walk", 2.38), ("survey", 6.84)])
def test_every_pose_is_measured_against_the_next_and_some_earlier_ones(layout: Layout, degree: float) -> None:
    graph = made(layout)
    steps = np.diff(graph.problem.edges)[:, 0] == 1
    assert steps.sum() == 99
    assert graph.problem.components.max() == 0
    assert graph.problem.degree.mean() == pytest.approx(degree, abs=0.06)
    if layout == "torus":
        assert set(graph.problem.degree) == {4}
    if layout == "survey":
        assert set(graph.problem.degree) == {3, 5, 8}


def test_errors_are_normal_but_for_closures_that_are_wrong() -> None:
    graph = made(wrong=0.25, n=900)
    assert graph.truth is not None
    assert graph.outliers is not None
    residuals = np.degrees(graph.problem.residuals(graph.truth))
    steps = np.diff(graph.problem.edges)[:, 0] == 1
    assert not graph.outliers[steps].any()
    assert graph.outliers.sum() == round(0.25 * (~steps).sum())
    assert np.sqrt((residuals[~graph.outliers] ** 2).mean() / 3) == pytest.approx(1.5, rel=0.04)
    assert np.median(residuals[graph.outliers]) == pytest.approx(132, abs=8)  # of uniform rotations


def test_a_seed_makes_one_graph_and_another_another() -> None:
    a, b, c = made("walk"), made("walk"), made("walk", seed=1)
    np.testing.assert_array_equal(a.problem.rotations, b.problem.rotations)
    assert not np.array_equal(a.problem.edges, c.problem.edges)
