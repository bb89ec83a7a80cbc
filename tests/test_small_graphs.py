"""The graphs of the regression pack, and the command that runs them."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import bench

from bench.core.errors import InputError
from bench.core.problem import Instance
from bench.datasets.small_graphs import RECIPES, SmallGraphs
from bench.plugins.catalog import catalog
from bench.running.conformance_datasets import check_dataset
from bench.suite.experiment import load_suite


def made(name: str, seed: int = 0) -> Instance:
    (source,) = SmallGraphs(name).sources(None, seed)
    return source.load()


@pytest.mark.parametrize("name", RECIPES)
def test_a_graph_is_what_it_says(name: str) -> None:
    instance, recipe = made(name), RECIPES[name]
    problem = instance.problem
    assert problem.n <= 60
    assert instance.statistics["limit_deg"] == recipe.limit_deg
    assert instance.truth is not None
    assert instance.outliers is not None
    inliers = np.degrees(problem.residuals(instance.truth))[~instance.outliers]
    assert np.median(inliers) <= max(3 * recipe.noise_deg, 1e-5)
    if recipe.outliers or recipe.folded:
        assert instance.outliers.any()
        assert np.median(np.degrees(problem.residuals(instance.truth))[instance.outliers]) > 10


def test_the_kinds_that_libraries_have_gone_wrong_on_are_there() -> None:
    assert made("disconnected").problem.components.max() == 1
    assert made("near-singular").statistics["hardness"] < 1e-3 < made("complete").statistics["hardness"]
    assert np.allclose(made("planar").truth[:, 2, 2], 1)  # type: ignore[index]
    pairs = made("parallel-edges").problem.edges
    assert len(np.unique(pairs, axis=0)) == len(pairs) / 3
    assert made("counts").problem.weights_kind == "count"
    assert made("precisions").problem.precisions is not None
    assert made("gravity").problem.gravity is not None
    assert len(RECIPES) >= 20


def test_they_pass_the_checks_of_datasets_and_follow_the_seed() -> None:
    assert [f.check for f in check_dataset(catalog("dataset")["small-graphs"], {}, None) if f.result == "failed"] == []
    assert not np.array_equal(made("grid", 0).problem.rotations, made("grid", 1).problem.rotations)
    with pytest.raises(InputError, match="did you mean 'ring'"):
        SmallGraphs("rin")


def test_the_suite_can_be_read() -> None:
    assert load_suite("regression-pack").datasets == ("small-graphs",)


BROKEN = '''
import numpy as np
from dataclasses import dataclass
from bench import Problem, method, so3

@method("broken", title="Broken", robust=True)
@dataclass(frozen=True)
class Broken:
    """Breaks on half-turns, loses a camera and is wrong elsewhere."""

    def solve(self, problem: Problem, rng: np.random.Generator) -> np.ndarray:
        if problem.n == 2:
            raise RuntimeError("two cameras")
        answer = so3.random(rng, problem.n)
        if problem.n == 3:
            answer[0] = np.nan
        return answer
'''


def test_the_command_says_what_fails(tmp_path: Path) -> None:
    plugin = tmp_path / "broken.py"
    plugin.write_text(BROKEN)
    command = ("regression-pack", "-m", "broken", "--plugin", plugin, "--seeds", 1, "--out", tmp_path / "run")
    lines = bench(*command, code=1).stdout.splitlines()
    assert lines[0] == "failed: broken on pair, seed 0: error(RuntimeError: two cameras)"
    assert lines[1] == "failed: broken on triangle, seed 0: 2 of 3 cameras solved"
    assert "where a working method stays below 5" in lines[2]
    assert f"{len(RECIPES)} jobs on small graphs: {len(RECIPES)} failed" in lines[-1]


def test_two_versions_are_paired(tmp_path: Path) -> None:
    """The same interpreter gives the same answers; a run of before is compared with one of today."""
    run = tmp_path / "run"
    command = ("regression-pack", "-m", "l1-irls", "--seeds", 1, "--out", run)
    done = bench(*command, "--python", sys.executable)
    assert "22 jobs on small graphs: 0 failed" in done.stdout
    assert done.stdout.splitlines()[-1] == "identical"
    assert (tmp_path / "run-other" / "plans").is_dir()
    again = bench(*command, "--against", tmp_path / "run-other")
    assert again.stdout.splitlines()[-1] == "identical"


WRAPPER = '''
from dataclasses import dataclass

import numpy as np

from bench import Problem, method, so3
from bench.methods.spectral import Spectral

@method("wrapper", title="Wrapper", requires=("solverlib",))
@dataclass(frozen=True)
class Wrapper:
    """What another library answers; its version 2 fails on two cameras and is off on every other graph."""

    def solve(self, problem: Problem, rng: np.random.Generator) -> np.ndarray:
        import solverlib

        if problem.n == 2 and solverlib.OFF_DEG:
            raise RuntimeError("two cameras")
        off = so3.exp(np.radians(solverlib.OFF_DEG) * rng.standard_normal((problem.n, 3)))
        return off @ Spectral().solve(problem, rng).rotations
'''


def test_a_library_that_became_worse_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two interpreters with two versions of a library: answers are paired, what changed is said, the exit code is 1."""
    (tmp_path / "wrapper.py").write_text(WRAPPER)
    for version, off_deg in ((1, 0), (2, 30)):
        installed = tmp_path / f"v{version}" / f"solverlib-{version}.0.dist-info"
        installed.mkdir(parents=True)
        (installed / "METADATA").write_text(f"Metadata-Version: 2.1\nName: solverlib\nVersion: {version}.0\n")
        (installed.parent / "solverlib.py").write_text(f"OFF_DEG = {off_deg}\n")
    older, python = os.pathsep.join([str(tmp_path / "v1"), *sys.path]), tmp_path / "python"
    python.write_text(f"#!/bin/sh\nPYTHONPATH='{older}' exec '{sys.executable}' \"$@\"\n")
    python.chmod(0o755)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "v2"), os.environ.get("PYTHONPATH", "")]))
    command = ("regression-pack", "-m", "wrapper", "--plugin", tmp_path / "wrapper.py", "--out", tmp_path / "run")
    done = bench(*command, "--seeds", 2, "--python", python, code=1)
    assert "solverlib 1.0 -> 2.0" in done.stderr
    said = "wrapper on small-graphs/pair, seed 0: ok -> error(RuntimeError: two cameras) (and so for 1 other job)"
    assert done.stdout.splitlines()[-1] == f"worse: wrapper; {said}"


def test_bad_input_is_one_sentence(tmp_path: Path) -> None:
    out = ("--out", tmp_path / "run")
    assert "No such file" in bench("regression-pack", "--python", tmp_path / "none", *out, code=2).stderr
    assert "leave out one" in bench("regression-pack", "--python", "p", "--against", "q", code=2).stderr
    assert "did you mean" in bench("regression-pack", "-m", "colmp", *out, code=2).stderr
    assert not (tmp_path / "run").exists()
