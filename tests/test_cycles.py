"""Residuals of triangles: exact on small graphs, uniform, and outliers that agree with each other are seen."""

import itertools

import numpy as np
import pytest
from graphs import grid_edges, random_edges, simulated
from scenes import load

from bench.core import so3
from bench.core.problem import Instance, Problem
from bench.datasets.erdos_renyi import ErdosRenyi
from bench.datasets.folded import Folded
from bench.scoring.metrics.cycles import agreeing_share, sample_cycles


def test_every_triangle_is_found_with_its_residual() -> None:
    problem, _ = simulated(random_edges(8, 0.5), noise_deg=20)
    block = {(int(i), int(j)): r for (i, j), r in zip(problem.edges, problem.rotations, strict=True)}
    wanted = {
        (a, b, c): np.degrees(so3.angle(block[a, b] @ block[b, c] @ block[a, c].T))
        for a, b, c in itertools.combinations(range(8), 3)
        if {(a, b), (b, c), (a, c)} <= block.keys()
    }
    cycles = sample_cycles(problem)
    cameras = [tuple(np.unique(problem.edges[row]).tolist()) for row in cycles.edges]
    assert set(cameras) == set(wanted)
    np.testing.assert_allclose(cycles.residuals, [wanted[triangle] for triangle in cameras], atol=1e-6)
    counts = np.unique([sorted(wanted).index(t) for t in cameras], return_counts=True)[1]
    assert np.abs(counts / counts.mean() - 1).max() < 4 / np.sqrt(counts.mean())


def test_a_graph_without_triangles_has_none() -> None:
    for edges in (grid_edges(3, 4), np.array([[0, 1]])):
        cycles = sample_cycles(simulated(edges)[0])
        assert (cycles.edges.shape, cycles.residuals.shape) == ((0, 3), (0,))
        assert np.isnan(agreeing_share(cycles, np.zeros(17)))


def test_noise_free_triangles_close() -> None:
    assert sample_cycles(simulated(random_edges(30, 0.4))[0]).residuals.max() < 1e-6


def share_of(instance: Instance) -> float:
    assert instance.truth is not None
    problem: Problem = instance.problem
    return agreeing_share(sample_cycles(problem), np.degrees(problem.residuals(instance.truth)))


def test_outliers_that_agree_close_their_cycles() -> None:
    assert share_of(load(ErdosRenyi())) < 0.01
    assert share_of(load(Folded(noise_deg=1.0, outliers=0.0, agreeing=1.0))) == pytest.approx(1, abs=0.1)
    assert 0.03 < share_of(load(Folded())) < 0.5
