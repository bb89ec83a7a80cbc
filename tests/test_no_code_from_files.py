"""Files are data: nothing in the project runs code that it finds in one, but the plug-ins that the user names."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import bench
import bench.datasets
import bench.methods

FOLDERS = [Path(str(package.__file__)).parent for package in (bench, bench.datasets, bench.methods)]
SOURCES = sorted(path for folder in FOLDERS for path in folder.rglob("*.py"))

FORBIDDEN_MODULES = {
    "pickle",
    "cPickle",
    "_pickle",
    "dill",
    "cloudpickle",
    "joblib",
    "shelve",
    "marshal",
    "yaml",
    "code",
}
FORBIDDEN_CALLS = {
    *("eval", "exec", "compile", "__import__", "execfile", "input"),
    *("os.system", "os.popen", "pty.spawn", "runpy.run_path", "runpy.run_module"),
    *("np.loadtxt", "np.genfromtxt", "np.fromfile", "np.memmap"),
    *("pd.read_pickle", "pandas.read_pickle", "pd.eval", "pandas.eval", "pd.read_hdf"),
    *("torch.hub.load", "torch.jit.load", "torch.compile"),
    *("tarfile.extractall", "archive.extractall", "archive.extract", "shutil.unpack_archive", "ast.literal_eval"),
}
# Where a module is imported whose name is not written in the source.
PLUGIN_IMPORTS = {
    ("bench/plugins/catalog.py", "importlib.import_module"),
    ("bench/plugins/catalog.py", "spec.loader.exec_module"),
    ("bench/plugins/catalog.py", "importlib.util.spec_from_file_location"),
    ("bench/__init__.py", "import_module"),
    ("bench/execution/child.py", "importlib.import_module"),
    ("bench/papers/layout.py", "importlib.import_module"),  # a module of bench.papers.kinds
    ("bench/execution/server.py", "importlib.import_module"),
}


def findings(source: str, name: str) -> list[str]:
    """Everything in a source that could run code from a file, each with its line."""
    found = []
    for node in ast.walk(ast.parse(source)):
        found += [f"{name}:{getattr(node, 'lineno', 0)}: {what}" for what in _wrong(node, name)]
    return found


def _wrong(node: ast.AST, name: str) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (f"import {a.name}" for a in node.names if a.name.split(".")[0] in FORBIDDEN_MODULES)
    elif isinstance(node, ast.ImportFrom) and node.level == 0:
        if (node.module or "").split(".")[0] in FORBIDDEN_MODULES:
            yield f"from {node.module} import"
    elif isinstance(node, ast.keyword):
        if node.arg == "shell" and not _is(node.value, False):
            yield "shell="
        if node.arg == "allow_pickle" and not _is(node.value, False):
            yield "allow_pickle="
    elif isinstance(node, ast.Call):
        yield from _wrong_call(node, ast.unparse(node.func), name)


def _wrong_call(node: ast.Call, called: str, name: str) -> Iterator[str]:
    keywords = {k.arg: k.value for k in node.keywords}
    if called in FORBIDDEN_CALLS:
        yield called
    if called in ("np.load", "numpy.load", "npy.read_array") and not _is(keywords.get("allow_pickle"), False):
        yield f"{called} without allow_pickle=False"
    if called == "torch.load" and not _is(keywords.get("weights_only"), True):
        yield "torch.load without weights_only=True"
    last = called.rsplit(".", 1)[-1]
    if last in ("import_module", "exec_module", "spec_from_file_location", "load_module") and (
        (name, called) not in PLUGIN_IMPORTS
    ):
        yield f"{called} outside the plug-in import"


def _is(node: ast.expr | None, value: bool) -> bool:
    return isinstance(node, ast.Constant) and node.value is value


def named(path: Path) -> str:
    folder = next(folder for folder in FOLDERS if path.is_relative_to(folder))
    return f"{folder.name}/{path.relative_to(folder).as_posix()}"


def test_no_source_runs_code_from_a_file() -> None:
    assert len(SOURCES) > 100
    assert [found for path in SOURCES for found in findings(path.read_text(encoding="utf-8"), named(path))] == []


def test_every_exception_is_still_needed() -> None:
    calls = {
        (named(path), ast.unparse(node.func))
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
    }
    assert calls >= PLUGIN_IMPORTS


@pytest.mark.parametrize(
    "source",
    [
        "import pickle",
        "from pickle import loads",
        "import yaml",
        "eval('1')",
        "exec(text)",
        "np.load(path)",
        "np.load(path, allow_pickle=True)",
        "np.savez(path, allow_pickle=flag)",
        "torch.load(path)",
        "torch.load(path, weights_only=False)",
        "subprocess.run(command, shell=True)",
        "archive.extractall(folder)",
        "importlib.import_module(name)",
    ],
)
def test_what_must_not_be_is_found(source: str) -> None:
    assert len(findings(source, "bench/x.py")) >= 1


@pytest.mark.parametrize(
    "source",
    ["np.load(path, allow_pickle=False)", "torch.load(path, weights_only=True)", "model.eval()", "re.compile('x')"],
)
def test_what_may_be_is_not(source: str) -> None:
    assert findings(source, "bench/x.py") == []
