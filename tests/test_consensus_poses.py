"""Consensus on graphs without triangles, such as those of poses: one scale for all cameras."""

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated

from bench.core import so3
from bench.core.problem import Floats, Ints, Problem
from bench.methods._lib.consensus.common_scale import with_common_scale
from bench.methods._lib.consensus.evidence import closing_angles, triangles_over_edges
from bench.methods._lib.consensus.half_edges import HalfEdges
from bench.methods._lib.consensus.settling import Settling
from bench.methods._lib.descent.descent import Descent
from bench.methods.consensus import Consensus
from bench.methods.l1_irls import L1IRLS

RNG = np.random.default_rng(0)  # the methods draw nothing from it
FIRST, WIDEST = np.radians(5), np.radians(20)


def torus(side: int) -> Ints:
    """Edges of a square grid whose borders are joined: four at a camera, no triangle."""
    ids = np.arange(side**2).reshape(side, side)
    pairs = [np.stack([ids, np.roll(ids, 1, axis)], axis=-1).reshape(-1, 2) for axis in (0, 1)]
    return np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0).astype(np.int32)


def spiral(side: int) -> Ints:
    """Edges of a walk in laps: from every camera to the next, and to the one that is a lap ahead."""
    n = side**2
    pairs = [np.stack([np.arange(n - step), np.arange(step, n)], axis=1) for step in (1, side)]
    return np.concatenate(pairs).astype(np.int32)


def wrong_closures(problem: Problem, share: float, seed: int) -> Problem:
    """With a share of the edges wrong, though none to the next camera."""
    rng = np.random.default_rng(seed)
    wrong = (rng.random(problem.m) < share) & (np.diff(problem.edges)[:, 0] != 1)
    rotations = problem.rotations.copy()
    rotations[wrong] = so3.random(rng, int(wrong.sum()))
    return Problem(problem.n, problem.edges, rotations)


def settled(problem: Problem, truth: Floats) -> tuple[float, float]:
    """The common scale that is found from the true cameras, in degrees, and the mean error there."""
    settling = Settling(problem, HalfEdges.of(problem), np.ones(problem.m), agreeing=5)
    fit = with_common_scale(problem, settling, Descent(problem, truth, 0.0), FIRST, WIDEST)
    return float(np.degrees(fit.scales[0])), float(errors_deg(so3.from_quaternion(fit.cameras), truth).mean())


def test_triangles_are_counted_over_edges() -> None:
    for edges, wanted in ((torus(8), 0), (random_edges(6, 1.0), 4), (random_edges(20, 1.0), 8)):
        problem, _ = simulated(edges)
        half = HalfEdges.of(problem)
        assert triangles_over_edges(half, problem.m, closing_angles(half, problem.m)) == pytest.approx(wanted)


def test_normal_errors_of_few_edges_are_averaged_as_by_least_squares() -> None:
    problem, truth = simulated(torus(12), noise_deg=3)
    squares = Descent(problem, truth, 0.0)
    for _ in range(8):
        squares.step(np.ones(problem.m))
    least = errors_deg(so3.from_quaternion(squares.cameras), truth).mean()
    assert errors_deg(Consensus().solve(problem, RNG).rotations, truth).mean() < 1.02 * least


def test_the_common_scale_follows_the_noise() -> None:
    scales = []
    for noise in (0.05, 0.5):
        problem, truth = simulated(torus(10), noise_deg=noise)
        scale, error = settled(wrong_closures(problem, 0.2, 0), truth)
        scales.append(scale)
        assert error < 3 * noise
    assert 4 < scales[1] / scales[0] < 25


@pytest.mark.parametrize("edges", [torus(14), spiral(14)])
def test_wrong_loop_closures_do_not_mislead(edges: Ints) -> None:
    errors = []
    for seed in range(3):
        problem, truth = simulated(edges, noise_deg=2, seed=seed)
        problem = wrong_closures(problem, 0.2, seed)
        errors.append([errors_deg(m.solve(problem, RNG).rotations, truth).mean() for m in (Consensus(), L1IRLS())])
    ours, others = np.mean(errors, axis=0)
    assert ours < 0.9 * others


def test_standard_errors_hold_what_they_say() -> None:
    within = []
    for seed in range(3):
        problem, truth = simulated(torus(12), noise_deg=2, seed=seed)
        problem = wrong_closures(problem, 0.05, seed)
        estimate = Consensus().solve(problem, RNG)
        assert estimate.camera_sigma is not None
        ratio = np.radians(errors_deg(estimate.rotations, truth)) / estimate.camera_sigma
        within.append([(ratio < 1).mean(), (ratio < 2).mean()])
    one, two = np.mean(within, axis=0)
    assert 0.55 < one < 0.8
    assert two > 0.93
