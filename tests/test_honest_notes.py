"""What a method says when it fell back or did not converge, and what it makes of parallel edges."""

from typing import Any

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated

from bench import Floats, Problem, so3
from bench.methods.cemp import CEMP
from bench.methods.crdmf import CRDMF
from bench.methods.desc import DESC
from bench.methods.dmf_synch import DMFSynch
from bench.methods.gnc import GNC
from bench.methods.gtsam_gnc import GtsamGNC
from bench.methods.hara import HARA
from bench.methods.l1_irls import L1IRLS
from bench.methods.mpls import MPLS
from bench.methods.r_godec import RGoDec
from bench.methods.robust_lm import RobustLM
from bench.methods.shonan import Shonan
from bench.methods.spanning_tree import SpanningTree
from bench.methods.staircase import Staircase
from bench.methods.tg_mcmc import TGMCMC
from bench.methods.weiszfeld import Weiszfeld

RNG = np.random.default_rng(0)


def ring(n: int) -> Problem:
    return simulated(np.array([(k, k + 1) for k in range(n - 1)] + [(0, n - 1)], dtype=np.int32))[0]


@pytest.mark.parametrize("method", [CEMP(), MPLS(), DESC(), HARA(), CRDMF()], ids=str)
def test_edges_in_no_triangle_are_counted(method: Any) -> None:
    without, _ = simulated(grid_edges(4, 4))
    notes = method.solve(without, RNG).notes
    assert any("24 of 24 edges in no triangle: " in note for note in notes)
    complete, _ = simulated(random_edges(6, 1.0))
    assert not any("triangle" in note for note in method.solve(complete, RNG).notes)


@pytest.mark.parametrize(
    ("method", "problem"),
    [(RGoDec(), simulated(grid_edges(10, 10))[0]), (TGMCMC(iterations=600), ring(100))],
    ids=["r-godec", "tg-mcmc"],
)
def test_an_iteration_limit_is_a_note(method: Any, problem: Problem) -> None:
    estimate = method.solve(problem, RNG)
    assert estimate.stop_reason == "iteration limit"
    assert any("not converged" in note for note in estimate.notes)


def test_mirror_images_are_a_note() -> None:
    half = random_edges(15, 1.0)
    bridged = np.concatenate([half, half + 15, [[14, 15]]]).astype(np.int32)
    problem, truth = simulated(bridged, seed=1)
    right = DMFSynch().solve(problem, RNG)
    assert errors_deg(right.rotations, truth).max() < 1e-3
    assert not right.notes
    wrong = DMFSynch(init="random").solve(problem, np.random.default_rng(0))
    assert errors_deg(wrong.rotations, truth).max() > 90
    assert any("15 of 30 cameras" in note for note in wrong.notes)


@pytest.mark.parametrize("method", [Staircase(), Shonan()], ids=str)
def test_certified_means_that_the_certificate_says_so(method: Any) -> None:
    pytest.importorskip("gtsam" if isinstance(method, Shonan) else "pymanopt")
    hopeless, _ = simulated(random_edges(12, 0.4, seed=2), noise_deg=60, outliers=0.5, seed=2)
    estimate = method.solve(hopeless, RNG)
    assert estimate.certificate < -0.1
    assert "certified" not in estimate.stop_reason
    assert any("not certified" in note for note in estimate.notes)
    easy, _ = simulated(random_edges(12, 0.4), noise_deg=5)
    estimate = method.solve(easy, RNG)
    assert estimate.certificate > -1e-4
    assert "certified" in estimate.stop_reason


def repeated() -> tuple[Problem, Floats]:
    """Exact measurements, four in ten of them repeated by one that is wrong."""
    problem, truth = simulated(random_edges(20, 0.4), seed=1)
    again = RNG.random(problem.m) < 0.4
    edges = np.concatenate([problem.edges[again], problem.edges])
    return Problem(20, edges, np.concatenate([so3.random(RNG, int(again.sum())), problem.rotations])), truth


@pytest.mark.parametrize(
    "method", [L1IRLS(), L1IRLS(init="cemp-mst"), GNC(), GtsamGNC(), RobustLM(), DMFSynch(), Weiszfeld()], ids=str
)
def test_parallel_edges_are_all_used(method: Any) -> None:
    if isinstance(method, GtsamGNC):
        pytest.importorskip("gtsam")
    problem, truth = repeated()
    assert errors_deg(method.solve(problem, RNG).rotations, truth).max() < 1


def test_the_heaviest_of_parallel_edges_is_in_the_tree() -> None:
    problem, truth = repeated()
    weights = np.where(problem.residuals(truth) < 1e-6, 2.0, 1.0)
    problem = Problem(problem.n, problem.edges, problem.rotations, weights)
    assert errors_deg(SpanningTree().solve(problem, RNG).rotations, truth).max() < 1e-6
