"""CEMP, MPLS and DESC: triangles and corruption levels against plain computations, and what they recover."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from graphs import errors_deg, grid_edges, random_edges, simulated, transformed

from bench.core import so3
from bench.core.problem import Estimate, Floats, Problem
from bench.datasets.erdos_renyi import ErdosRenyi
from bench.methods._lib.descent.simplex_descent import consistent_levels
from bench.methods._lib.graph.cemp import corruption_levels
from bench.methods._lib.graph.triangles import Triangles, codegrees, sample_triangles
from bench.methods._lib.starts import start_rotations
from bench.methods.cemp import CEMP
from bench.methods.desc import DESC
from bench.methods.l1_irls import L1IRLS
from bench.methods.mpls import MPLS
from bench.methods.spectral import Spectral
from bench.plugins.declare import Source
from bench.scoring.metrics.roc import roc_auc

ALL = 10**6
METHODS = [CEMP(), CEMP(solver="gcw"), MPLS(), DESC()]
EVERY_METHOD = pytest.mark.parametrize("method", METHODS, ids=["cemp", "cemp-gcw", "mpls", "desc"])


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def by_hand(problem: Problem) -> dict[tuple[int, int], float]:
    """d_ij,k under (edge ij, camera k), for every triangle."""
    edge = {(int(i), int(j)): e for e, (i, j) in enumerate(problem.edges)}
    measured = {pair: problem.rotations[e] for pair, e in edge.items()}
    measured |= {(j, i): r.T for (i, j), r in measured.items()}
    found = {}
    for corners in combinations(range(problem.n), 3):
        if all(pair in edge for pair in combinations(corners, 2)):
            for k in corners:
                i, j = sorted(set(corners) - {k})
                cycle = measured[i, j] @ measured[j, k] @ measured[k, i]
                found[edge[i, j], k] = float(so3.angle(cycle)) / np.pi
    return found


def as_dict(problem: Problem, triangles: Triangles) -> dict[tuple[int, int], float]:
    found = {}
    for e in range(problem.m):
        for t in range(triangles.counts[e]):
            at_i, at_j = (set(problem.edges[side].tolist()) for side in triangles.sides[e, t])
            i, j = problem.edges[e].tolist()
            assert i in at_i
            assert j in at_j
            (k,) = at_i & at_j
            assert (e, k) not in found
            found[e, k] = float(triangles.inconsistency[e, t])
    return found


def test_every_triangle_is_found_with_its_inconsistency() -> None:
    problem, _ = simulated(random_edges(14, 0.4), noise_deg=10, outliers=0.3)
    wanted = by_hand(problem)
    found = as_dict(problem, sample_triangles(problem, ALL, rng()))
    assert found == pytest.approx(wanted, abs=1e-12)
    np.testing.assert_array_equal(codegrees(problem), np.bincount([e for e, _ in wanted], minlength=problem.m))


def test_a_sample_is_without_repetition_and_depends_on_the_seed_alone() -> None:
    problem, _ = simulated(random_edges(20, 0.6), noise_deg=10)
    every = by_hand(problem)
    drawn: set[tuple[int, int]] = set()
    for seed in range(30):
        triangles = sample_triangles(problem, 3, rng(seed))
        np.testing.assert_array_equal(triangles.counts, np.minimum(codegrees(problem), 3))
        found = as_dict(problem, triangles)
        assert found == as_dict(problem, sample_triangles(problem, 3, rng(seed)))
        assert found == pytest.approx({key: every[key] for key in found}, abs=1e-12)
        drawn |= set(found)
    assert drawn == set(every)


def test_labels_and_edge_order_do_not_matter_where_all_triangles_fit() -> None:
    problem, _ = simulated(random_edges(30, 0.5), noise_deg=5, outliers=0.3)
    other, order = transformed(problem)
    levels = corruption_levels(sample_triangles(problem, ALL, rng(0)))
    relabelled = corruption_levels(sample_triangles(other, ALL, rng(1)))
    place = {tuple(sorted(pair)): e for e, pair in enumerate(problem.edges.tolist())}
    same = [place[tuple(sorted(order[pair].tolist()))] for pair in other.edges]
    np.testing.assert_allclose(relabelled, levels[same], atol=1e-12)


def test_message_passing_is_that_of_the_paper() -> None:
    problem, _ = simulated(random_edges(14, 0.5), noise_deg=10, outliers=0.3)
    triangles = by_hand(problem)
    edge = {frozenset(pair): e for e, pair in enumerate(problem.edges.tolist())}
    levels = np.ones(problem.m)
    for beta in (0, 1, 2, 4):
        weights, sums = np.zeros(problem.m), np.zeros(problem.m)
        for (e, k), inconsistency in triangles.items():
            i, j = problem.edges[e].tolist()
            weight = np.exp(-beta * (levels[edge[frozenset((i, k))]] + levels[edge[frozenset((j, k))]]))
            weights[e] += weight
            sums[e] += weight * inconsistency
        levels = np.divide(sums, weights, out=np.ones(problem.m), where=weights > 0)
    np.testing.assert_allclose(corruption_levels(sample_triangles(problem, ALL, rng()), 3), levels, atol=1e-12)


def test_the_quadratic_program_is_that_of_the_paper() -> None:
    problem, _ = simulated(random_edges(8, 0.6), noise_deg=20, outliers=0.3)
    triangles = sample_triangles(problem, 2, rng())
    used = np.arange(triangles.sides.shape[1]) < triangles.counts[:, None]
    distances = np.where(used, triangles.inconsistency, 0.0)
    sides = np.where(used[..., None], triangles.sides, 0)

    def levels(shares: Floats) -> Floats:
        return np.where(used.any(axis=1), (shares * distances).sum(axis=1), 1.0)

    def objective(shares: Floats) -> float:
        return float((shares * levels(shares)[sides].sum(axis=2)).sum())

    shares = used / np.maximum(triangles.counts, 1)[:, None]
    costs = [objective(shares)]
    for step in range(8):
        np.testing.assert_allclose(consistent_levels(triangles, 0.1, step), levels(shares), atol=1e-8)
        slopes = np.zeros_like(shares)
        for place in zip(*np.nonzero(used), strict=True):
            shift = np.zeros_like(shares)
            shift[place] = 1e-5
            slopes[place] = (objective(shares + shift) - objective(shares - shift)) / 2e-5
        moved = shares - 0.1 * slopes
        for e in np.flatnonzero(triangles.counts):
            shares[e, : triangles.counts[e]] = nearest_on_simplex(moved[e, : triangles.counts[e]])
        costs.append(objective(shares))
    assert (np.diff(costs) < 0).all()


def nearest_on_simplex(point: Floats) -> Floats:
    """By bisection for what is subtracted."""
    low, high = point.min() - 1, point.max()
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if np.maximum(point - middle, 0).sum() > 1 else (low, middle)
    return np.maximum(point - low, 0)


def paper(noise_deg: float, seed: int) -> tuple[Problem, Floats, np.ndarray]:
    (source,) = ErdosRenyi(n=200, noise_deg=noise_deg).sources(None, seed)
    assert isinstance(source, Source)
    instance = source.load()
    assert instance.truth is not None
    assert instance.outliers is not None
    return instance.problem, instance.truth, instance.outliers


@pytest.mark.parametrize("seed", [0, 1, 2])
@EVERY_METHOD
def test_edge_weights_tell_the_outliers(method: CEMP | MPLS | DESC, seed: int) -> None:
    problem, truth, outliers = paper(5.0, seed)
    estimate = method.solve(problem, rng(seed))
    assert estimate.edge_weights is not None
    assert roc_auc(estimate.edge_weights, outliers) >= 0.999
    spectral = errors_deg(Spectral().solve(problem, rng()).rotations, truth).mean()
    assert errors_deg(estimate.rotations, truth).mean() < 0.75 * spectral


@pytest.mark.parametrize(
    "method",
    [
        CEMP(),
        MPLS(),
        DESC(),
        DESC(rate=1.0, descent_iterations=30),
        L1IRLS(loss="l-half", tolerance_deg=1e-4),
        L1IRLS(loss="l-half", init="cemp-mst"),
    ],
    ids=["cemp", "mpls", "desc", "desc-few-large-steps", "l1-irls", "l1-irls-from-cemp"],
)
def test_without_noise_the_truth_is_recovered(method: CEMP | MPLS | DESC | L1IRLS) -> None:
    problem, truth, _ = paper(0.0, 0)
    assert errors_deg(method.solve(problem, rng()).rotations, truth).max() < 1e-4


def test_the_start_is_the_tree_of_cemp() -> None:
    problem, truth, _ = paper(5.0, 1)
    np.testing.assert_array_equal(start_rotations("cemp-mst", problem, rng(4)), CEMP().solve(problem, rng(4)).rotations)
    assert not L1IRLS(init="cemp-mst").deterministic
    assert errors_deg(start_rotations("cemp-mst", problem, rng()), truth).max() < 10


def barbell() -> tuple[Problem, Floats]:
    """Two dense groups joined by one edge, and a camera that hangs on another; those edges are in no triangle."""
    group = random_edges(15, 0.7)
    edges = np.concatenate([group, group + 15, [[3, 20], [7, 30]]])
    return simulated(edges.astype(np.int32), noise_deg=1)


@EVERY_METHOD
def test_edges_in_no_triangle_are_kept_where_nothing_else_connects(method: CEMP | MPLS | DESC) -> None:
    problem, truth = barbell()
    estimate: Estimate = method.solve(problem, rng())
    assert errors_deg(estimate.rotations, truth).max() < 12
    assert corruption_levels(sample_triangles(problem, ALL, rng()))[-2:].tolist() == [1, 1]


@EVERY_METHOD
def test_a_graph_without_triangles_is_solved(method: CEMP | MPLS | DESC) -> None:
    problem, truth = simulated(grid_edges(6, 20))
    assert errors_deg(method.solve(problem, rng()).rotations, truth).max() < 1e-6


@pytest.mark.real_data
def test_ellis_island(real_data: Path) -> None:
    from bench.datasets.one_dsfm import OneDSfM

    (source,) = OneDSfM(scene="Ellis_Island").sources(real_data / "1dsfm", 0)
    assert isinstance(source, Source)
    instance = source.load()
    assert instance.truth is not None
    for method, mean, median in ((CEMP(), 3.8, 0.95), (MPLS(), 3.5, 0.6), (DESC(), 2.6, 0.55)):
        found = errors_deg(method.solve(instance.problem, rng()).rotations, instance.truth)  # type: ignore[attr-defined]
        assert found.mean() < mean
        assert np.median(found) < median


def test_places_without_a_triangle_hold_no_leftovers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fresh memory may hold anything, and dividing that warned in one call of five."""
    monkeypatch.setattr("bench.methods._lib.graph.triangles.np.empty", leftovers)
    problem, _ = simulated(random_edges(30, 0.2), noise_deg=5)
    triangles = sample_triangles(problem, ALL, rng())
    unfilled = np.arange(triangles.inconsistency.shape[1]) >= triangles.counts[:, None]
    assert unfilled.any()
    assert (triangles.inconsistency[unfilled] == 0).all()


def leftovers(shape: int | tuple[int, ...], dtype: type = float) -> np.ndarray:
    return np.full(shape, np.nan if dtype is float else 7, dtype=dtype)
