"""What declares itself deterministic is so to the bit, whatever the seed and the process; liars are found."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from test_conformance import CONFIGURATIONS

from bench.core.digest import digest
from bench.core.limits import Limits
from bench.plugins.catalog import catalog
from bench.plugins.selection import format_selection
from bench.running.conformance import check_method
from bench.running.engines.local import LocalEngine
from bench.running.run import Options, Run
from bench.storage.store import Store
from bench.suite.experiment import Cell

PROBLEM = "erdos-renyi[n=16,missing=0.5,outliers=0.2]"
LIES = ("seed", "system", "global", "hash", "clock")


def deterministic_cells(run: Run) -> list[Cell]:
    return [c for c in run.cells if not c.method.varies(c.method.configure(c.job.parameters))]


def estimates(cells: Sequence[Cell], store: Store, seed: int) -> dict[str, bytes]:
    """Run the cells under another seed, by an engine of their own: the bytes of every estimate, or how it failed."""
    seeded = [replace(c, job=replace(c.job, id=digest([c.job.id, seed]), seed=seed)) for c in cells]
    found = {}
    for cell, record in LocalEngine(store, Limits(60, 4), 2).run(seeded):
        name = format_selection(cell.job.method, cell.job.parameters)
        ok = record.outcome.ok
        found[name] = store.estimate(cell.job.id).rotations.tobytes() if ok else record.outcome.text.encode()
    return found


def differing(run: Run) -> set[str]:
    """Run every cell twice, under two seeds; the configured methods whose estimates differ in a bit."""
    cells = deterministic_cells(run)
    run.prepare()
    first, second = (estimates(cells, run.store, seed) for seed in (1, 2))
    assert len(first) == len(second) == len(cells)
    return {name for name in first if first[name] != second[name]}


def test_every_deterministic_configuration_is_bit_identical_under_other_seeds(tmp_path: Path) -> None:
    run = Run("quick", CONFIGURATIONS, [PROBLEM], Options(out=tmp_path))
    assert len(deterministic_cells(run)) > len(run.cells) / 2
    assert differing(run) == set()


@pytest.fixture
def liar(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A method that declares itself deterministic and is not, in the way it is told to."""
    monkeypatch.delenv("PYTHONHASHSEED", raising=False)  # dask sets it, and leaves it
    path = tmp_path / "liar.py"
    path.write_text(LIAR)
    return path


def test_liars_are_found(liar: Path, tmp_path: Path) -> None:
    run = Run("quick", ["liar"], [PROBLEM], Options(out=tmp_path / "honest", plugins=(liar,)))
    assert differing(run) == set()
    selected = f"liar[lie=[{','.join(LIES)}]]"
    run = Run("quick", [selected], [PROBLEM], Options(out=tmp_path / "lies", plugins=(liar,)))
    assert differing(run) == {f"liar[lie={lie}]" for lie in LIES}


@pytest.mark.parametrize("lie", LIES)
def test_check_finds_them_too(liar: Path, lie: str) -> None:
    info = catalog("method", [liar])["liar"]
    findings = {f.check: f for f in check_method(info, {"lie": lie})}
    assert findings["deterministic as declared"].result == "failed"
    assert {f.check for f in check_method(info, {}) if f.result == "failed"} == set()


def test_another_method_or_dataset_changes_nobody_s_numbers(faulty_plugin: Path, tmp_path: Path) -> None:
    methods, datasets = ["faulty[fault=random]", "cemp"], ["toy", "erdos-renyi[n=12,missing=0.2]"]
    alone = Run("quick", methods[:1], datasets[:1], Options(out=tmp_path / "a", plugins=(faulty_plugin,), seeds=2))
    others = Run("quick", methods[::-1], datasets[::-1], Options(out=tmp_path / "b", plugins=(faulty_plugin,), seeds=2))
    for run in (alone, others):
        run.prepare()
        assert {record.outcome.kind for _, record in run.execute()} == {"ok"}
    shared = {cell.job.id for cell in alone.cells}
    assert len(shared) == 2
    assert shared <= {cell.job.id for cell in others.cells}
    for cell in alone.cells:
        here, there = (run.store.estimate(cell.job.id).rotations for run in (alone, others))
        assert here.tobytes() == there.tobytes()
        here, there = (run.store.instance(cell.job.instance_key).problem.rotations for run in (alone, others))
        assert here.tobytes() == there.tobytes()


LIAR = '''
"""Spectral, turned by an angle that is drawn where the declaration says that nothing is."""
import os, time
from dataclasses import dataclass
import numpy as np
from bench import method, so3


@method("liar", title="Liar", exact_to_deg=1e-3)
@dataclass(frozen=True)
class Liar:
    """The eigenvectors of the block matrix, with a lie."""
    lie: str = ""

    def solve(self, problem, rng):
        angle = {
            "": lambda: 0.0,
            "seed": lambda: rng.random(),
            "system": lambda: int.from_bytes(os.urandom(2), "big"),
            "global": lambda: np.random.random(),
            "hash": lambda: hash("camera") % 1000,
            "clock": lambda: time.time_ns() % 1e9,
        }[self.lie]()
        values, vectors = np.linalg.eigh(problem.block_matrix().toarray() + np.kron(np.diag(problem.degree), np.eye(3)))
        blocks = vectors[:, -3:].reshape(-1, 3, 3)
        blocks = blocks * np.sign(np.linalg.det(blocks).sum())
        return so3.project(blocks) @ so3.exp(np.array([1e-6 * angle, 0, 0]))
'''
