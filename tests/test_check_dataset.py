"""The checks of datasets: built-in ones pass, and each fault of a plug-in is named."""

from pathlib import Path

import pytest
from commands import bench

from bench.core.errors import InputError
from bench.plugins.catalog import catalog
from bench.running.conformance import Finding
from bench.running.conformance_datasets import CHECKS, check_dataset

PLUGIN = """
from dataclasses import dataclass
import os, socket
import numpy as np
from bench import Instance, Problem, Source, dataset, so3, stream

@dataset("mine", title="Mine")
@dataclass(frozen=True)
class Mine:
    fault: str = ""
    n: int = 6

    def sources(self, data_dir, seed):
        if self.fault == "sources":
            raise KeyError("scene")
        if self.fault == "not-sources":
            yield "a scene"
        name = {"name": f"a b/{self.n}", "same-name": "mine"}.get(self.fault, f"n{self.n}")
        revision = {"revision": f"{seed}", "seed-revision": f"{self.n}"}.get(self.fault, f"{self.n}-{seed}")
        yield Source(name, revision, lambda: self._load(name, revision, seed), seeded=self.fault != "unseeded")

    def _load(self, name, revision, seed):
        rng = stream(0 if self.fault == "constant" else seed, "data", "mine")
        if self.fault == "load":
            return 1 / 0
        if self.fault == "network":
            try:
                socket.create_connection(("localhost", 9))
            except OSError:
                pass
        if self.fault == "unstable":
            rng = np.random.default_rng()
        if self.fault == "process":
            rng = np.random.default_rng([os.getpid(), seed])
        truth = so3.random(rng, self.n)
        i, j = np.triu_indices(self.n, k=1)
        measured = truth[i] @ np.swapaxes(truth[j], -1, -2)
        outliers = np.arange(len(i)) % 3 == 0
        measured[outliers] = so3.random(rng, outliers.sum())
        if self.fault == "inliers":
            outliers = ~outliers
        if self.fault == "transposed":
            truth = np.swapaxes(truth, -1, -2)
        if self.fault == "scaled":
            truth = 2 * truth
        if self.fault == "short":
            truth = truth[1:]
        if self.fault == "reversed":
            i, j = j, i
        problem = Problem(self.n, np.stack([i, j], axis=1), measured)
        return Instance(problem, truth, name, outliers, revision="?" if self.fault == "other" else revision)
"""


@pytest.fixture
def plugin(tmp_path: Path) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(PLUGIN, encoding="utf-8")
    return path


def checked(plugin: Path, fault: str) -> list[Finding]:
    return list(check_dataset(catalog("dataset", [plugin])["mine"], {"fault": fault}))


@pytest.mark.parametrize("text", ["erdos-renyi[n=12]", "folded[n=12]"])
def test_built_in_datasets_conform(text: str) -> None:
    found = list(check_dataset(*catalog("dataset").one(text)))
    assert [f.result for f in found] == ["passed"] * len(CHECKS)


def test_a_good_plugin_passes_every_check(plugin: Path) -> None:
    assert [f.result for f in checked(plugin, "")] == ["passed"] * len(CHECKS)


@pytest.mark.parametrize(
    ("fault", "check", "detail"),
    [
        ("name", "instances", "the name 'a b/6' has signs other than"),
        ("other", "loading", "the source's revision is '6-0', and the loaded instance's '?'"),
        ("network", "no network", "called localhost 9"),
        ("scaled", "truth", "6 of 6 true matrices are no rotations"),
        ("transposed", "truth fits the measurements", "camera to world"),
        ("inliers", "truth fits the measurements", "the inliers are"),
        ("unstable", "same seed same data", "loaded twice under one seed"),
        ("process", "same seed same data", "in another process"),
        ("constant", "another seed", "seed 1 gives the data of seed 0"),
        ("unseeded", "another seed", "seeded=True"),
        ("seed-revision", "another seed", "other data under the same revision"),
        ("same-name", "parameters", "n=7 changes the data but not their place, mine (all)"),
        ("revision", "parameters", "n=7 changes the data but not their revision, 0"),
    ],
)
def test_a_fault_is_found_by_its_check(plugin: Path, fault: str, check: str, detail: str) -> None:
    failed = {f.check: f.detail for f in checked(plugin, fault) if f.result == "failed"}
    assert detail in failed[check]
    assert len(failed) == 1 or fault == "unstable"


def line(start: str) -> int:
    return next(k for k, text in enumerate(PLUGIN.splitlines(), 1) if text.strip().startswith(start))


@pytest.mark.parametrize(
    ("fault", "where", "what"),
    [
        ("sources", "raise KeyError", "KeyError: 'scene'"),
        ("load", "return 1 / 0", "ZeroDivisionError: division by zero"),
        ("reversed", "problem = Problem", "edge"),
    ],
)
def test_what_a_dataset_raises_is_a_sentence_with_file_and_line(
    plugin: Path, fault: str, where: str, what: str
) -> None:
    with pytest.raises(InputError) as told:
        checked(plugin, fault)
    assert f"{plugin}:{line(where)}: " in str(told.value)
    assert what in str(told.value)


@pytest.mark.parametrize(
    ("fault", "what"), [("not-sources", "yields 'a scene', not Source"), ("short", "truth of shape (5, 3, 3)")]
)
def test_what_is_no_instance_is_refused(plugin: Path, fault: str, what: str) -> None:
    with pytest.raises(InputError) as told:
        checked(plugin, fault)
    assert str(told.value).startswith(f"{plugin}: ")
    assert what in str(told.value)


def test_a_dataset_that_fails_in_a_run_is_one_sentence(plugin: Path, tmp_path: Path) -> None:
    selection = "mine[fault=load]"
    done = bench("run", "-m", "spectral", "-d", selection, "--plugin", plugin, "--out", tmp_path / "run", code=2)
    assert done.stderr.count("\n") == 1
    assert f"{plugin}:{line('return 1 / 0')}: ZeroDivisionError" in done.stderr


def test_a_new_dataset_is_checked_and_run(tmp_path: Path) -> None:
    bench("new", "dataset", "my-data", "--into", tmp_path)
    path = tmp_path / "my_data.py"
    assert len(path.read_text().splitlines()) <= 36
    assert "my-data: fit to be benchmarked" in bench("check", "dataset", "my-data", "--plugin", path).stdout
    run = bench("run", "--plugin", path, "-d", "my-data[n=8]", "-m", "spectral", "--out", tmp_path / "run")
    assert "1 job on 1 instance" in run.stdout
