"""Consensus on graphs such as those of poses, few normal errors at each: one scale for all cameras."""

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated

from bench.core import so3
from bench.core.problem import Floats, Problem
from bench.datasets.collection_graph import CollectionGraph
from bench.datasets.neurora_graphs import NeuRoRAGraphs
from bench.datasets.street_graph import StreetGraph
from bench.datasets.trajectory import Layout, Trajectory
from bench.methods._lib.consensus.common_scale import with_common_scale
from bench.methods._lib.consensus.evidence import closing_angles, errors_are_normal, triangles_over_edges
from bench.methods._lib.consensus.half_edges import HalfEdges
from bench.methods._lib.consensus.settling import Settling
from bench.methods._lib.consensus.solution import solution
from bench.methods._lib.descent.descent import Descent
from bench.methods.consensus import Consensus
from bench.methods.l1_irls import L1IRLS
from bench.plugins.declare import Dataset, Source

RNG = np.random.default_rng(0)  # the methods draw nothing from it
FIRST, WIDEST = np.radians(5), np.radians(20)


def poses(layout: Layout, n: int, noise_deg: float, wrong: float, seed: int = 0) -> tuple[Problem, Floats]:
    """A trajectory with a share of its loop closures wrong, and its truth."""
    (source,) = Trajectory(n, layout, noise_deg, wrong).sources(None, seed)
    graph = source.load()
    assert graph.truth is not None
    return graph.problem, graph.truth


def least_squares(problem: Problem, truth: Floats, weights: Floats) -> float:
    """The mean error of least squares with weights (m,), from the true cameras."""
    descent = Descent(problem, truth, 0.0)
    for _ in range(8):
        descent.step(weights)
    return float(errors_deg(so3.from_quaternion(descent.cameras), truth).mean())


def settled(problem: Problem, truth: Floats) -> float:
    """The mean error with the common scale that is found from the true cameras."""
    settling = Settling(problem, HalfEdges.of(problem), np.ones(problem.m), agreeing=5)
    fit = with_common_scale(problem, settling, Descent(problem, truth, 0.0), FIRST, WIDEST)
    return float(errors_deg(so3.from_quaternion(fit.cameras), truth).mean())


def test_triangles_are_counted_over_edges() -> None:
    complete = [simulated(random_edges(n, 1.0))[0] for n in (6, 20)]
    for problem, wanted in zip([poses("torus", 64, 0, 0)[0], *complete], (0, 4, 8), strict=True):
        half = HalfEdges.of(problem)
        assert triangles_over_edges(half, problem.m, closing_angles(half, problem.m)) == pytest.approx(wanted)


def closes_as_normal(problem: Problem) -> bool:
    return errors_are_normal(closing_angles(HalfEdges.of(problem), problem.m))


@pytest.mark.parametrize("wrong", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("noise_deg", [0.5, 3.0])
def test_triangles_tell_that_errors_are_normal(noise_deg: float, wrong: float) -> None:
    assert closes_as_normal(poses("survey", 225, noise_deg, wrong)[0])


@pytest.mark.parametrize("dataset", [CollectionGraph(n=60), StreetGraph(n=80), NeuRoRAGraphs(60, 100)])
def test_triangles_tell_that_some_cameras_err_more_than_others(dataset: Dataset) -> None:
    for seed in range(3):
        (source,) = dataset.sources(None, seed)
        assert isinstance(source, Source)
        assert not closes_as_normal(source.load().problem)


def test_no_triangles_or_exact_ones_tell_nothing() -> None:
    assert not closes_as_normal(poses("torus", 64, noise_deg=1, wrong=0)[0])
    assert not closes_as_normal(poses("survey", 225, noise_deg=0, wrong=0.1)[0])


def test_cameras_have_scales_of_their_own_where_many_edges_tell_them() -> None:
    few, (dense, _) = poses("survey", 144, noise_deg=2, wrong=0)[0], simulated(random_edges(40, 0.6), noise_deg=2)
    assert closes_as_normal(dense)
    assert dense.degree.mean() > 17
    assert np.ptp(solution(few).fit.scales) == 0
    assert np.ptp(solution(dense).fit.scales) > 0


@pytest.mark.parametrize("layout", ["torus", "survey"])
def test_normal_errors_of_few_edges_are_averaged_as_by_least_squares(layout: Layout) -> None:
    problem, truth = poses(layout, 144, noise_deg=3, wrong=0)
    least = least_squares(problem, truth, np.ones(problem.m))
    assert errors_deg(Consensus().solve(problem, RNG).rotations, truth).mean() < 1.02 * least


@pytest.mark.parametrize("turned_deg", [8.0, 180.0])
def test_wrong_edges_cost_little_more_than_leaving_them_out(turned_deg: float) -> None:
    """Those that are off by little are told at a scale below the first one only."""
    problem, truth = poses("torus", 144, noise_deg=0.1, wrong=0)
    rng = np.random.default_rng(0)
    wrong = rng.random(problem.m) < 0.1
    turns = so3.exp(np.radians(turned_deg) * so3.random_axes(rng, problem.m))
    rotations = np.where(wrong[:, None, None], problem.rotations @ turns, problem.rotations)
    problem = Problem(problem.n, problem.edges, rotations)
    assert settled(problem, truth) < 1.1 * least_squares(problem, truth, np.where(wrong, 1e-9, 1.0))


@pytest.mark.parametrize("layout", ["torus", "spiral", "survey"])
def test_wrong_loop_closures_do_not_mislead(layout: Layout) -> None:
    errors = []
    for seed in range(3):
        problem, truth = poses(layout, 196, noise_deg=2, wrong=0.2, seed=seed)
        errors.append([errors_deg(m.solve(problem, RNG).rotations, truth).mean() for m in (Consensus(), L1IRLS())])
    ours, others = np.mean(errors, axis=0)
    assert ours < 0.9 * others


@pytest.mark.parametrize("layout", ["torus", "survey"])
def test_standard_errors_hold_what_they_say(layout: Layout) -> None:
    within = []
    for seed in range(3):
        problem, truth = poses(layout, 144, noise_deg=2, wrong=0.1, seed=seed)
        estimate = Consensus().solve(problem, RNG)
        assert estimate.camera_sigma is not None
        ratio = np.radians(errors_deg(estimate.rotations, truth)) / estimate.camera_sigma
        within.append([(ratio < 1).mean(), (ratio < 2).mean()])
    one, two = np.mean(within, axis=0)
    assert 0.55 < one < 0.8
    assert two > 0.93
