"""Weights and precisions: what a weighted sum means, and that match counts lead where residuals alone do not."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graphs import errors_deg, random_edges, simulated

from bench import Estimate, Floats, Problem, so3
from bench.methods._lib.graph.confidence import confidence
from bench.methods._lib.linear.certificate import chordal_cost
from bench.methods._lib.starts import resolved
from bench.methods.bcd import BCD
from bench.methods.crdmf import CRDMF
from bench.methods.desc import DESC
from bench.methods.dmf_synch import DMFSynch
from bench.methods.gnc import GNC
from bench.methods.gtsam_gnc import GtsamGNC
from bench.methods.hara import HARA
from bench.methods.l1_irls import L1IRLS
from bench.methods.lie_averaging import LieAveraging
from bench.methods.maks import MAKS
from bench.methods.martinec_pajdla import MartinecPajdla
from bench.methods.mpls import MPLS
from bench.methods.quaternion import Quaternion
from bench.methods.rcd import RCD
from bench.methods.robust_lm import RobustLM
from bench.methods.sdp import SDP
from bench.methods.shonan import Shonan
from bench.methods.spanning_tree import SpanningTree
from bench.methods.spectral import Spectral
from bench.methods.staircase import Staircase
from bench.methods.tg_mcmc import TGMCMC
from bench.methods.weiszfeld import Weiszfeld

IMAGES = Path(__file__).parents[2] / "shared" / "data" / "image_graphs"
CHORDAL = [RCD(), BCD(), MAKS(), Staircase(), SDP(eps=1e-8)]
SQUARES = [
    *CHORDAL,
    Spectral(),
    MartinecPajdla(),
    Quaternion(),
    LieAveraging(),
    TGMCMC(noise_deg=0),
    pytest.param(Shonan(), marks=pytest.mark.filterwarnings("ignore")),
]
ROBUST = [L1IRLS(), RobustLM(), Weiszfeld(), MPLS(), DESC(), HARA(), DMFSynch(), CRDMF()]


def solved(method: Any, problem: Problem) -> Estimate:
    if isinstance(method, Shonan | GtsamGNC):
        pytest.importorskip("gtsam")
    if isinstance(method, SDP):
        pytest.importorskip("cvxpy")
    if isinstance(method, Staircase):
        pytest.importorskip("pymanopt")
    found: Estimate = method.solve(problem, np.random.default_rng(0))
    return found


def weighted(problem: Problem, weights: Floats, kind: Any = "precision") -> Problem:
    return Problem(problem.n, problem.edges, problem.rotations, weights, kind)


def noisy(seed: int = 0) -> tuple[Problem, Floats]:
    """Twelve cameras, five degrees of noise, and weights between a tenth and ten."""
    problem, _ = simulated(random_edges(12, 0.5, seed), noise_deg=5, seed=seed)
    return problem, 10 ** np.random.default_rng(seed).uniform(-1, 1, problem.m)


def test_the_confidence_has_mean_one() -> None:
    problem, weights = noisy()
    precisions = weights[:, None, None] * np.diag([1.0, 2, 3])
    np.testing.assert_array_equal(confidence(problem), 1)
    np.testing.assert_allclose(confidence(weighted(problem, weights)), weights / weights.mean())
    both = Problem(problem.n, problem.edges, problem.rotations, precisions=precisions)
    np.testing.assert_allclose(confidence(both), weights / weights.mean())


@pytest.mark.parametrize(
    "method",
    [
        *CHORDAL[:-1],
        *[method for method in ROBUST if not isinstance(method, Weiszfeld)],
        *(kind(init="spectral") for kind in (Weiszfeld, Quaternion, TGMCMC)),  # a tree of equal weights is another
        GNC(),
        Spectral(),
    ],
    ids=str,
)
def test_equal_weights_are_none(method: Any) -> None:
    problem, _ = noisy()
    plain = solved(method, problem)
    equal = solved(method, weighted(problem, np.full(problem.m, 4.0)))
    np.testing.assert_array_equal(equal.rotations, plain.rotations)
    assert equal.cost == plain.cost


def test_certifying_methods_reach_one_weighted_optimum() -> None:
    problem, weights = noisy()
    problem = weighted(problem, weights)
    costs = [solved(method, problem).cost for method in CHORDAL]
    np.testing.assert_allclose(costs, costs[0], rtol=1e-6)
    unweighted = solved(RCD(), problem.keeping([])).rotations
    assert costs[0] is not None
    assert costs[0] < 0.95 * chordal_cost(problem, unweighted)


@pytest.mark.parametrize("method", CHORDAL, ids=str)
def test_the_certificate_is_that_of_the_weighted_cost(method: Any) -> None:
    problem, weights = noisy()
    certificate = solved(method, weighted(problem, weights)).certificate
    assert certificate is not None
    assert certificate > -1e-3


@pytest.mark.parametrize(
    "method",
    [
        *CHORDAL,
        Spectral(normalised=False),
        MartinecPajdla(),
        Quaternion(init="spectral"),
        LieAveraging(init="spectral", tolerance_deg=1e-7),
        Shonan(tolerance=1e-12),
        L1IRLS(tolerance_deg=1e-7),
        RobustLM(tolerance_deg=1e-7),
        GNC(tolerance_deg=1e-7),
        Weiszfeld(init="spectral", tolerance_deg=1e-7),
        TGMCMC(noise_deg=0, init="spectral", tolerance_deg=1e-7),
    ],
    ids=str,
)
def test_a_weight_is_a_number_of_parallel_edges(method: Any) -> None:
    problem, _ = noisy(1)
    times = np.random.default_rng(1).integers(1, 4, problem.m)
    parallel = Problem(problem.n, np.repeat(problem.edges, times, axis=0), np.repeat(problem.rotations, times, axis=0))
    many = solved(method, parallel).rotations
    one = solved(method, weighted(problem, times.astype(float))).rotations
    plain = solved(method, problem).rotations
    creeps = isinstance(method, Weiszfeld)
    assert errors_deg(one, many).max() < (5e-3 if creeps else 1e-4)
    assert errors_deg(plain, many).max() > 0.05


def ring_with_a_worthless_edge(weight: float) -> tuple[Problem, Floats]:
    """Eight cameras in a ring with chords, exact but for one edge that is turned by 90 degrees."""
    edges = [(k, k + 1) for k in range(7)] + [(0, 7), (0, 4), (1, 5), (2, 6), (3, 7)]
    problem, truth = simulated(np.array(edges, dtype=np.int32), seed=3)
    rotations, scale = problem.rotations.copy(), np.ones(problem.m)
    rotations[7] = so3.exp(np.array([0, 0, np.pi / 2])) @ rotations[7]
    scale[7] = weight
    precisions = 1e4 * scale[:, None, None] * np.eye(3)
    return Problem(8, problem.edges, rotations, precisions=precisions), truth


@pytest.mark.parametrize("method", [*SQUARES, *ROBUST, SpanningTree()], ids=str)
def test_an_edge_of_no_information_does_not_count(method: Any) -> None:
    problem, truth = ring_with_a_worthless_edge(1e-9)
    assert errors_deg(solved(method, problem).rotations, truth).max() < 1e-4


def test_shonan_agrees_with_gtsam_itself() -> None:
    gtsam = pytest.importorskip("gtsam")
    problem, _ = ring_with_a_worthless_edge(1e-9)
    assert problem.precisions is not None
    measurements = [
        gtsam.BinaryMeasurementRot3(i, j, gtsam.Rot3(r), gtsam.noiseModel.Isotropic.Precision(3, float(p[0, 0])))
        for (i, j), r, p in zip(problem.edges.tolist(), problem.rotations, problem.precisions, strict=True)
    ]
    descent = gtsam.LevenbergMarquardtParams.CeresDefaults()
    descent.setRelativeErrorTol(1e-12)
    averaging = gtsam.ShonanAveraging3(measurements, gtsam.ShonanAveragingParameters3(descent))
    values, _ = averaging.run(averaging.initializeRandomly(), 3, 10)
    own = np.array([values.atRot3(k).matrix().T for k in range(problem.n)])
    assert errors_deg(Shonan().solve(problem, np.random.default_rng(0)).rotations, own).max() < 1e-5


def counted(seed: int) -> tuple[Problem, Floats]:
    """Two thirds outliers, half of which turn one third of the cameras as one piece; their matches are few."""
    rng = np.random.default_rng(seed)
    problem, truth = simulated(random_edges(30, 0.6, seed), noise_deg=1, seed=seed)
    i, j = problem.edges.T
    turned = so3.exp(np.array([0, 0, np.pi / 2])) @ truth
    across = (i < 20) & (j >= 20)
    wrong = (across & (rng.random(problem.m) < 0.85)) | (rng.random(problem.m) < 0.3)
    rotations = problem.rotations.copy()
    rotations[wrong] = so3.random(rng, int(wrong.sum()))
    rotations[across & wrong] = (truth[i] @ np.swapaxes(turned[j], -1, -2))[across & wrong]
    counts = np.where(wrong, rng.integers(15, 40, problem.m), rng.integers(30, 300, problem.m))
    return Problem(problem.n, problem.edges, rotations, counts.astype(float), "count"), truth


@pytest.mark.parametrize("method", [L1IRLS(), RobustLM(), Weiszfeld(), DMFSynch(), GNC()], ids=str)
def test_match_counts_lead_where_most_edges_mislead(method: Any) -> None:
    problem, truth = counted(0)
    assert errors_deg(solved(method, problem).rotations, truth).max() < 10
    assert errors_deg(solved(method, problem.keeping([])).rotations, truth).max() > 20


@pytest.mark.parametrize("scene", ["castle-P30", "lego"])
@pytest.mark.parametrize("method", ROBUST, ids=str)
def test_real_scenes_with_match_counts_are_solved(method: Any, scene: str) -> None:
    path = IMAGES / f"{scene}.npz"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    with np.load(path) as data:
        weights, truth = data["weights"].astype(float), data["truth"]
        problem = Problem(int(data["n"]), data["edges"], data["rotations"], weights, "count")
    assert errors_deg(solved(method, problem).rotations, truth).max() < 10


def test_a_start_by_counts_has_no_l1_stage_and_says_so() -> None:
    problem, _ = counted(0)
    assert [resolved("auto", p) for p in (problem, problem.keeping([]))] == ["spanning-tree", "spectral"]
    assert resolved("auto", weighted(problem, np.arange(1.0, problem.m + 1))) == "spectral"
    assert any("no L1 stage" in note for note in solved(L1IRLS(), problem).notes)
    assert not solved(L1IRLS(), problem.keeping([])).notes
