"""The door for Python users: solve, score, report; run is tried in test_runner."""

from pathlib import Path

import numpy as np
import pytest
from graphs import random_edges, simulated

import bench
from bench import Estimate, InputError, so3


@pytest.fixture(scope="module")
def graph() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    problem, truth = simulated(random_edges(12, 0.6), 1.0)
    return problem.edges, problem.rotations, truth


@pytest.mark.parametrize("supervised", [False, True])
def test_solve_finds_the_rotations_and_score_says_how_well(graph: tuple, supervised: bool) -> None:
    edges, rotations, truth = graph
    estimate = bench.solve(edges, rotations, supervised=supervised)
    assert isinstance(estimate, Estimate)
    scores = bench.score(estimate, truth)
    assert scores["n_scored"] == 12
    assert 0 < scores["median_deg"] < 2
    turned = bench.score(estimate.rotations @ so3.exp(np.array([1.0, 2, 0])), truth)
    assert turned["mean_deg"] == pytest.approx(scores["mean_deg"], abs=1e-6)


def test_this_process_and_a_child_find_the_same(graph: tuple) -> None:
    here = bench.solve(*graph[:2], method="spectral")
    np.testing.assert_array_equal(here.rotations, bench.solve(*graph[:2], method="spectral", supervised=True).rotations)


def test_edges_may_stand_in_either_order(graph: tuple) -> None:
    edges, rotations, _ = graph
    reverse = np.arange(len(edges)) % 2 == 0
    flipped = np.where(reverse[:, None], edges[:, ::-1], edges)
    turned = np.where(reverse[:, None, None], np.swapaxes(rotations, 1, 2), rotations)
    one, other = (bench.solve(*pair, method="spectral").rotations for pair in ((edges, rotations), (flipped, turned)))
    np.testing.assert_allclose(one, other, atol=1e-12)


def test_cameras_outside_the_largest_component_have_no_rotation(graph: tuple) -> None:
    edges = np.concatenate([graph[0], [[12, 13]]])
    estimate = bench.solve(edges, np.concatenate([graph[1], np.eye(3)[None]]), n=15)
    assert np.isnan(estimate.rotations[12:]).all()
    assert np.isfinite(estimate.rotations[:12]).all()
    assert any("12 of 15 cameras" in note for note in estimate.notes)


def test_weights_reach_the_method(graph: tuple) -> None:
    edges, rotations, _ = graph
    weights = np.random.default_rng(0).uniform(0.1, 10, len(edges))
    plain, weighted = (bench.solve(edges, rotations, "spanning-tree", w).rotations for w in (None, weights))
    assert not np.array_equal(plain, weighted)


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ({"edges": [[0.5, 1]]}, r"whole numbers of shape \(m, 2\)"),
        ({"edges": [[0, 1], [1, 2]]}, r"rotations must have shape \(2, 3, 3\)"),
        ({"method": "spectrall"}, "did you mean 'spectral'"),
        ({"method": "spectral[normalised=[true,false]]"}, "stands for 2 configurations"),
        ({"n": 1}, "camera ids go from 0 to 0"),
        ({"weights": [0.0]}, "weight of edge 0"),
    ],
)
def test_misuse_of_solve_is_one_sentence(arguments: dict, what: str) -> None:
    with pytest.raises(InputError, match=what):
        bench.solve(**{"edges": [[0, 1]], "rotations": np.eye(3)[None], **arguments})


def test_a_child_that_does_not_end_well_is_one_sentence(faulty_plugin: Path) -> None:
    with pytest.raises(InputError, match="faulty: crashed"):
        bench.solve([[0, 1]], np.eye(3)[None], "faulty[fault=segfault]", plugins=[faulty_plugin], supervised=True)


def test_a_method_meant_for_fewer_cameras_declines_in_this_process_too() -> None:
    edges = [[k, k + 1] for k in range(400)]
    with pytest.raises(bench.Skipped, match="401 cameras, and sdp is meant for at most 300"):
        bench.solve(edges, np.tile(np.eye(3), (400, 1, 1)), "sdp")


def test_misuse_of_score_is_one_sentence() -> None:
    with pytest.raises(InputError, match=r"shape \(n, 3, 3\), not \(2, 3, 3\) and \(3, 3, 3\)"):
        bench.score(np.tile(np.eye(3), (2, 1, 1)), np.tile(np.eye(3), (3, 1, 1)))
    with pytest.raises(InputError, match="did you mean 'l1'"):
        bench.score(np.tile(np.eye(3), (2, 1, 1)), np.tile(np.eye(3), (2, 1, 1)), "l")


def test_report_writes_the_page_of_a_run(tmp_path: Path) -> None:
    frame = bench.run(methods=["spectral"], datasets=["erdos-renyi[n=8,missing=0.2]"], out=str(tmp_path / "run"))
    assert frame["outcome"].tolist() == ["ok"]
    page = bench.report(tmp_path / "run")
    assert page == tmp_path / "run" / "report.html"
    assert "spectral" in page.read_text()
