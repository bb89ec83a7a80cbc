"""Consensus: its triangles, votes, scales and pieces against their definitions, and what it recovers."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated

from bench.core import so3
from bench.core.problem import Floats, Ints, Problem
from bench.methods._lib.consensus import half_edges
from bench.methods._lib.consensus.evidence import (
    closing_angles,
    noise_scale,
    support_by_triangles,
)
from bench.methods._lib.consensus.growth import grown
from bench.methods._lib.consensus.half_edges import HalfEdges
from bench.methods._lib.consensus.prior import prior_weights
from bench.methods._lib.consensus.recombination import Judge, recombined
from bench.methods._lib.consensus.settling import Settling
from bench.methods.consensus import Consensus
from bench.methods.l1_irls import L1IRLS

RNG = np.random.default_rng(0)  # the method draws nothing from it


def solved(problem: Problem) -> Floats:
    return Consensus().solve(problem, RNG).rotations


def measured(n: int, edges: Ints, truth: Floats, wrong: dict[int, Floats] | None = None) -> Problem:
    """Noise-free measurements, but for the `wrong` ones."""
    rotations = truth[edges[:, 0]] @ np.swapaxes(truth[edges[:, 1]], -1, -2)
    for edge, rotation in (wrong or {}).items():
        rotations[edge] = rotation
    return Problem(n, edges, rotations)


def test_triangles_vouch_for_edges_by_how_well_they_close() -> None:
    problem, _ = simulated(random_edges(12, 0.6), outliers=0.4)
    known = {
        (int(i), int(j)): (e, r) for e, ((i, j), r) in enumerate(zip(problem.edges, problem.rotations, strict=True))
    }
    scales, wanted = np.radians([2.0, 20.0]), np.zeros((2, problem.m))
    for i, j, k in itertools.combinations(range(12), 3):
        if {(i, j), (j, k), (i, k)} <= set(known):
            (a, first), (b, second), (c, third) = known[i, j], known[j, k], known[i, k]
            chord = 4 * np.sin(so3.angle_between(first @ second, third) / 4)
            for edge in (a, b, c):
                wanted[:, edge] += (1 + (chord / scales) ** 2) ** -2
    assert wanted.max() > 1
    np.testing.assert_allclose(support_by_triangles(HalfEdges.of(problem), problem.m, scales), wanted, atol=1e-9)


def test_a_budget_leaves_each_edge_its_triangles_with_the_cameras_of_highest_rank(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a complete graph, where all triangles close, each edge has as many as there are, or as are allowed."""
    problem, _ = simulated(random_edges(30, 1.0))
    half = HalfEdges.of(problem)
    np.testing.assert_allclose(support_by_triangles(half, problem.m, np.ones(1)), 28, rtol=1e-9)
    monkeypatch.setattr("bench.methods._lib.consensus.evidence.BUDGET", 20 * problem.m)
    np.testing.assert_allclose(support_by_triangles(half, problem.m, np.ones(1)), 20, rtol=1e-9)


def test_the_strongest_edges_are_those_of_either_end() -> None:
    """Of equal weights those to cameras of higher rank."""
    problem, _ = simulated(random_edges(20, 0.8))
    half, most = HalfEdges.of(problem), 4
    for weights in (np.random.default_rng(0).random(problem.m), np.arange(problem.m) % 3.0, np.ones(problem.m)):
        wanted = set()
        for first, last in itertools.pairwise(half.first.tolist()):
            wanted |= set(sorted(half.ids[first:last].tolist(), key=lambda edge: -weights[edge])[:most])
        found = half.strongest(weights, most)
        assert set(found.ids.tolist()) == wanted
        assert len(found.ids) == 2 * len(wanted)
        degree = np.bincount(problem.edges[sorted(wanted)].ravel(), minlength=problem.n)
        np.testing.assert_array_equal(np.diff(found.first), degree)


def test_the_noise_scale_is_that_of_good_triangles() -> None:
    edges = random_edges(60, 0.5)
    scales = {}
    for outliers in (0.0, 0.6):
        for noise in (0.5, 2.0):
            problem, _ = simulated(edges, noise_deg=noise, outliers=outliers)
            scales[outliers, noise] = np.degrees(noise_scale(closing_angles(HalfEdges.of(problem), problem.m)))
    assert scales[0.0, 2.0] == pytest.approx(4 * scales[0.0, 0.5], rel=0.1)
    assert scales[0.6, 2.0] < 4 * scales[0.0, 2.0]
    chain = Problem(3, np.array([[0, 1], [1, 2]], dtype=np.int32), np.tile(np.eye(3), (2, 1, 1)))
    assert np.degrees(noise_scale(closing_angles(HalfEdges.of(chain), 2))) == pytest.approx(5)


def test_growth_puts_a_camera_where_most_neighbours_want_it() -> None:
    n, truth = 6, so3.random(np.random.default_rng(1), 6)
    edges = np.stack(np.triu_indices(n, 1), axis=1).astype(np.int32)
    to_last = np.flatnonzero(edges[:, 1] == n - 1)
    wrong = {int(edge): so3.random(np.random.default_rng(2 + e), 1)[0] for e, edge in enumerate(to_last[:2])}
    problem = measured(n, edges, truth, wrong)
    half = HalfEdges.of(problem)
    vouched = support_by_triangles(half, problem.m, np.radians([2.0]))[0]
    for root in range(n):
        cameras = grown(half, vouched + 1e-3, np.radians(2.0), root)
        assert errors_deg(so3.from_quaternion(cameras), truth).max() < 0.1


def test_only_the_strongest_edges_take_part() -> None:
    problem, _ = simulated(random_edges(30, 0.9))
    weights = np.random.default_rng(0).random(problem.m)
    half = HalfEdges.of(problem).strongest(weights, 4)
    degree = np.diff(half.first)
    assert degree.min() == 4
    for camera in range(problem.n):
        mine = np.flatnonzero((problem.edges == camera).any(axis=1))
        best = set(mine[np.argsort(-weights[mine])[:4]].tolist())
        assert best <= set(half.ids[half.first[camera] : half.first[camera + 1]].tolist())


def test_two_crowds_that_one_weak_edge_connects_stay_connected() -> None:
    crowd = random_edges(45, 1.0)
    edges = np.concatenate([crowd, crowd + 45, [[0, 89]]]).astype(np.int32)
    problem, truth = simulated(edges, noise_deg=0.1)
    assert errors_deg(solved(problem), truth).max() < 1


def test_the_scale_of_a_camera_is_where_enough_of_its_edges_agree() -> None:
    problem, _ = simulated(random_edges(40, 0.9), outliers=0.3)
    settling = Settling(problem, HalfEdges.of(problem), np.ones(problem.m), 5)
    angles = np.random.default_rng(0).uniform(0.01, 1, problem.m)
    scales = settling.scales(angles)
    for camera in range(problem.n):
        mine = (problem.edges == camera).any(axis=1)
        assert ((1 + (angles[mine] / scales[camera]) ** 2) ** -2).sum() == pytest.approx(5, rel=0.03)


def test_a_turned_piece_of_another_solution_is_taken_over() -> None:
    problem, truth = simulated(random_edges(40, 0.4), noise_deg=0.1)
    turned = truth.copy()
    turned[:9] = turned[:9] @ so3.exp(np.array([0.0, 0.6, 0.0]))
    gauge = so3.random(np.random.default_rng(3), 1)[0]
    judge = Judge(problem, np.radians(0.5))
    cameras, pieces = recombined(judge, so3.to_quaternion(turned), so3.to_quaternion(truth @ gauge), np.radians(5.0))
    assert pieces >= 1
    assert errors_deg(so3.from_quaternion(cameras), truth).max() < 0.5
    again, none = recombined(judge, so3.to_quaternion(truth), so3.to_quaternion(turned @ gauge), np.radians(5.0))
    assert none == 0
    np.testing.assert_array_equal(again, so3.to_quaternion(truth))


def test_gravity_tells_wrong_tilts_and_not_wrong_headings() -> None:
    truth = so3.random(np.random.default_rng(0), 3)
    edges = np.array([[0, 1], [0, 2], [1, 2]], dtype=np.int32)
    down = truth @ np.array([0.0, -1.0, 0.0])
    heading, tilt = (so3.exp(np.radians(30.0) * axis) for axis in (down[0], np.cross(down[0], truth[0, :, 0])))
    exact = measured(3, edges, truth).rotations
    rotations = np.stack([heading @ exact[0], tilt @ exact[1], exact[2]])
    weights = prior_weights(Problem(3, edges, rotations, gravity=down), np.radians(2.0))
    np.testing.assert_allclose(weights, [1.0, 0.01, 1.0], atol=1e-9)
    unknown = np.where(np.arange(3)[:, None] == 0, np.nan, down)
    np.testing.assert_allclose(prior_weights(Problem(3, edges, rotations, gravity=unknown), np.radians(2.0)), 1.0)


def test_most_edges_may_be_wrong() -> None:
    problem, truth = simulated(random_edges(60, 0.9), noise_deg=1.0, outliers=0.75)
    assert errors_deg(solved(problem), truth).max() < 2
    assert errors_deg(L1IRLS().solve(problem, RNG).rotations, truth).max() > 45


def test_a_long_ring_with_outliers_closes() -> None:
    """10 of the next 50 cameras are neighbours, so that what is wrong adds up along the way."""
    rng, n = np.random.default_rng(0), 600
    steps = np.concatenate([rng.choice(50, 10, replace=False) + 1 for _ in range(n)])
    i = np.repeat(np.arange(n), 10)
    edges = np.unique(np.sort(np.stack([i, (i + steps) % n], axis=1), axis=1), axis=0).astype(np.int32)
    problem, truth = simulated(edges, noise_deg=3.0, outliers=0.2)
    assert errors_deg(solved(problem), truth).mean() < 2


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("scene", "mean", "median"),
    [("Ellis_Island", 1.65, 0.39), ("NYC_Library", 1.40, 0.80)],
)
def test_photographs(real_data: Path, scene: str, mean: float, median: float) -> None:
    from bench.datasets.one_dsfm import OneDSfM
    from bench.plugins.declare import Source

    source = next(iter(OneDSfM(scene=scene).sources(real_data / "1dsfm", 0)))
    assert isinstance(source, Source)
    instance = source.load()
    assert instance.truth is not None
    errors = errors_deg(solved(instance.problem), instance.truth)
    assert errors.mean() < mean
    assert np.median(errors) < median


def test_cameras_of_many_edges_are_warmed_up_too(monkeypatch: pytest.MonkeyPatch) -> None:
    called = []
    for name in ("_mark_strongest", "_reach"):
        kernel = getattr(half_edges, name)
        monkeypatch.setattr(half_edges, name, lambda *args, k=kernel, n=name: (called.append(n), k(*args)))
    Consensus().warm_up()
    assert set(called) == {"_mark_strongest", "_reach"}
