"""The identity of a job changes with everything of its own that its method runs, and with nothing else."""

import pkgutil
import shutil
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

import pytest

from bench.methods import _lib
from bench.plugins import source_hash
from bench.plugins.catalog import catalog
from bench.plugins.source_hash import hash_of_module
from bench.running.run import Options, Run

Edit = Callable[[str], None]
KERNELS = [m.name for m in pkgutil.walk_packages(_lib.__path__, f"{_lib.__name__}.") if not m.ispkg]
PACKAGE = {
    "__init__.py": "",
    "mine.py": "import json\n\ndef solve():\n    from .parts.kernel import step\n    return step\n",
    "other.py": "",
    "parts/__init__.py": "",
    "parts/kernel.py": "from . import deeper\nstep = deeper.step\n",
    "parts/deeper.py": "step = 1\n",
    "parts/unused.py": "",
}


@pytest.fixture
def edit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Edit:
    """Have a module read as if it had been edited; called again, that one alone."""
    whole = source_hash._file_of

    def edited(module: str) -> None:
        file = whole(module)
        assert file is not None
        copy = Path(shutil.copy(file, tmp_path / file.name))
        copy.write_text(copy.read_text() + "\n# edited\n")
        monkeypatch.setattr(source_hash, "_file_of", lambda name: copy if name == module else whole(name))

    return edited


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Folder of a package of plug-ins, on the path."""
    name = "rotsync_hashed_package"
    for file, text in PACKAGE.items():
        path = tmp_path / name / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path / name
    for loaded in [module for module in sys.modules if module.partition(".")[0] == name]:
        del sys.modules[loaded]


def ids(method: str) -> set[str]:
    run = Run(None, [method], ["erdos-renyi[n=5]"], Options(out=Path("nowhere")))
    return {cell.job.id for cell in run.cells}


@pytest.mark.parametrize("module", ["bench.core.so3", "bench.core.problem"])
def test_another_vocabulary_makes_new_jobs_of_every_method(edit: Edit, module: str) -> None:
    before, jobs = {info.name: info.source_hash for info in catalog("method")}, ids("spectral")
    edit(module)
    assert not before.items() & {info.name: info.source_hash for info in catalog("method")}.items()
    assert not jobs & ids("spectral")


def test_another_kernel_makes_new_jobs_of_the_methods_that_use_it_and_of_no_other(edit: Edit) -> None:
    before = {info.name: info.source_hash for info in catalog("method")}
    jobs = {name: ids(name) for name in before}
    changes = {}
    for kernel in KERNELS:
        edit(kernel)
        changes[kernel] = {info.name for info in catalog("method") if info.source_hash != before[info.name]}
    assert all(changes.values())
    assert any(changed < before.keys() for changed in changes.values())
    for name, own in jobs.items():  # the last edit is in force
        assert own.isdisjoint(ids(name)) == (name in changes[KERNELS[-1]])


@pytest.mark.parametrize("file", ["mine.py", "parts/kernel.py", "parts/deeper.py"])
def test_what_is_imported_inside_a_function_counts(package: Path, file: str) -> None:
    module = import_module(f"{package.name}.mine")
    before = hash_of_module(module)
    (package / file).write_text(PACKAGE[file] + "# edited\n")
    assert hash_of_module(module) != before


@pytest.mark.parametrize("file", ["other.py", "parts/unused.py"])
def test_what_is_not_imported_does_not(package: Path, file: str) -> None:
    module = import_module(f"{package.name}.mine")
    before = hash_of_module(module)
    (package / file).write_text("# edited\n")
    assert hash_of_module(module) == before
