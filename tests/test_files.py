"""Graphs of one's own: a path in place of a dataset, the truth beside it, doubts told, any two files scored."""

from pathlib import Path

import numpy as np
import pytest
from commands import bench as command
from graphs import random_edges, simulated

import bench
from bench import InputError, so3
from bench.datasets.files import Files
from bench.formats import holds, rotations_writer


def written(path: Path, seed: int = 0, **arrays: np.ndarray) -> np.ndarray:
    """A graph of 12 cameras as .npz; its truth (n, 3, 3)."""
    problem, truth = simulated(random_edges(12, 0.6, seed), 1.0, seed=seed)
    np.savez(path, edges=problem.edges, rotations=problem.rotations, **arrays)
    return truth


def sources(path: Path, truth: Path | str = "") -> list:
    return list(Files(str(path), str(truth)).sources(None, 0))


def write_truth(path: Path, truth: np.ndarray) -> None:
    rotations_writer(path)(np.arange(len(truth)), truth, {})


def test_a_file_is_an_instance_with_the_truth_that_is_named(tmp_path: Path) -> None:
    truth = written(tmp_path / "mine.npz")
    write_truth(tmp_path / "truth.txt", truth)
    (alone,), (scored,) = sources(tmp_path / "mine.npz"), sources(tmp_path / "mine.npz", tmp_path / "truth.txt")
    assert alone.name == scored.name == "mine"
    assert alone.revision != scored.revision
    assert alone.load().truth is None
    np.testing.assert_allclose(scored.load().truth, truth, atol=1e-15)


def test_the_truth_in_the_file_itself_is_taken(tmp_path: Path) -> None:
    truth = written(tmp_path / "a.npz")
    written(tmp_path / "b.npz", truth=truth)
    assert holds(tmp_path / "a.npz") == {"graph"}
    assert holds(tmp_path / "b.npz") == {"graph", "rotations"}
    np.testing.assert_allclose(sources(tmp_path / "b.npz")[0].load().truth, truth, atol=1e-15)


def test_a_folder_stands_for_the_graphs_in_it(tmp_path: Path) -> None:
    graphs, truths = tmp_path / "graphs", tmp_path / "truths"
    graphs.mkdir()
    truths.mkdir()
    for seed, name in enumerate(("one", "two")):
        write_truth(truths / f"{name}.csv", written(graphs / f"{name}.npz", seed))
    (graphs / "notes.md").write_text("nothing of a graph")
    (truths / "two.csv").unlink()
    found = sources(graphs, truths)
    assert [source.name for source in found] == ["one", "two"]
    assert [source.load().truth is None for source in found] == [False, True]


def test_truth_of_a_part_is_said(tmp_path: Path) -> None:
    truth = written(tmp_path / "mine.npz")
    write_truth(tmp_path / "part.txt", truth[:5])
    instance = sources(tmp_path / "mine.npz", tmp_path / "part.txt")[0].load()
    assert "truth of 5 of 12 cameras" in instance.notes
    assert np.isnan(instance.truth[5:]).all()


def test_what_cannot_be_is_one_sentence(tmp_path: Path) -> None:
    truth = written(tmp_path / "mine.npz")
    written(tmp_path / "other.npz")
    rotations_writer(tmp_path / "far.txt")(np.arange(100, 112), truth, {})
    (tmp_path / "empty").mkdir()
    for path, beside, what in (
        ("", "", "needs a path"),
        (tmp_path / "none.g2o", "", "there is no such file"),
        (tmp_path / "mine.npz", tmp_path / "none", "there is no such file"),
        (tmp_path / "empty", "", "no graph in this folder"),
        (tmp_path, tmp_path / "far.txt", "there are 2 graphs"),
    ):
        with pytest.raises(InputError, match=what):
            sources(path, beside)
    with pytest.raises(InputError, match="none of its 12 cameras is in the graph, by their ids"):
        sources(tmp_path / "mine.npz", tmp_path / "far.txt")[0].load()
    with pytest.raises(InputError, match="--truth is that of a file"):
        bench.run(methods=["spectral"], truth="x")


def test_a_path_runs_in_place_of_a_dataset(tmp_path: Path) -> None:
    write_truth(tmp_path / "truth.txt", written(tmp_path / "mine.npz"))
    arguments = ("run", "-m", "spectral", "-d", "mine.npz", "--truth", "truth.txt", "--out", "run")
    assert "files / mine" in command(*arguments, cwd=tmp_path).stdout
    frame = bench.run(
        methods=["spectral"],
        datasets=[str(tmp_path / "mine.npz")],
        truth=str(tmp_path / "truth.txt"),
        out=tmp_path / "other",
    )
    assert 0 < frame["mean_deg"].item() < 3


def test_truth_in_other_axes_is_told_by_every_verb(tmp_path: Path) -> None:
    """As COLMAP's export for Bundler has it: y and z of every camera point the other way."""
    truth = written(tmp_path / "mine.npz")
    write_truth(tmp_path / "truth.txt", np.diag([1.0, -1, -1]) @ truth)
    frame_of = ("run", "-m", "spectral", "-d", "mine.npz", "--truth", "truth.txt", "--out", "run")
    for done in (
        command(*frame_of, cwd=tmp_path),
        command("table", "run", cwd=tmp_path),
        command("data", "inspect", "files[path=mine.npz,truth=truth.txt]", cwd=tmp_path),
    ):
        assert "with diag(1, -1, -1) R_i in place of R_i" in " ".join((done.stdout + done.stderr).split())


def test_solve_says_what_nothing_checks_and_what_was_used(tmp_path: Path) -> None:
    chain = "".join(f"{i} {i + 1} 1 0 0 0 1 0 0 0 1 0 0 0\n" for i in range(7))
    (tmp_path / "chain.txt").write_text(chain)
    done = command("solve", "chain.txt", "-o", "out.txt", cwd=tmp_path)
    assert "the graph is a tree: 0 of 7 edges lie in a loop" in done.stdout
    assert "residual 0" not in done.stdout
    problem, _ = simulated(random_edges(12, 0.6), 1.0)
    np.savez(tmp_path / "mine.npz", edges=problem.edges, rotations=problem.rotations, weights=np.ones(problem.m))
    used = command("solve", "mine.npz", "-m", "spanning-tree", "-o", "out.txt", cwd=tmp_path).stdout
    refused = command("solve", "mine.npz", "-m", "spanning-tree", "-o", "o.txt", "--use", "none", cwd=tmp_path).stdout
    assert "weights: used" in used
    assert "consensus: " in done.stdout
    assert "ended by: all steps done" in done.stdout
    assert "weights: not used by spanning-tree" in refused


def test_transposed_measurements_are_told_without_truth(tmp_path: Path) -> None:
    problem, _ = simulated(random_edges(12, 0.6), 1.0)
    np.savez(tmp_path / "mine.npz", edges=problem.edges, rotations=np.swapaxes(problem.rotations, 1, 2))
    done = command("solve", "mine.npz", "-o", "out.txt", cwd=tmp_path)
    assert "R_ij^T in place of R_ij" in done.stdout


def test_any_two_files_are_scored(tmp_path: Path) -> None:
    truth = written(tmp_path / "mine.npz")
    write_truth(tmp_path / "truth.csv", truth)
    turned = truth @ so3.exp(np.array([0.3, 1.0, -2.0]))
    turned[3] = so3.exp(np.array([0.1, 0, 0])) @ turned[3]
    write_truth(tmp_path / "estimate.txt", turned)
    shown = command("score", "estimate.txt", "truth.csv", cwd=tmp_path).stdout
    assert "12 of 12 cameras scored, alignment l1" in shown
    assert float(shown.split("max_deg")[1].split()[0]) == pytest.approx(np.degrees(0.1), abs=1e-4)


def test_every_format_is_listed() -> None:
    listed = command("data", "formats").stdout
    for name in ("g2o", "database.db", "images.txt", "open3d", "matlab", "tum", "kitti", "log"):
        assert name in listed
