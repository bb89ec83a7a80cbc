"""The tree shows the flow: imports point downward, the harness names no method, and every folder has its place."""

import ast
import re
import subprocess
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import bench
from bench.plugins.catalog import catalog

ROOT = Path(__file__).parent.parent
# From the bottom to the top; what stands beside each other may not import each other.
ORDER = (
    ("core",),
    ("plugins", "formats"),
    ("learning",),
    ("suite",),
    ("storage",),
    ("execution",),
    ("running",),
    ("scoring",),
    ("training",),
    ("reporting",),
    ("papers", "maps", "site", "advice"),
    ("api",),
    ("cli",),
    ("__main__",),
)
RANK = {name: rank for rank, names in enumerate(ORDER) for name in names}
# What a plug-in may know of the harness, besides the names that `bench` itself offers.
ALLOWED: dict[str, set[str]] = {"methods": set(), "datasets": {"formats"}}


@cache
def sources() -> dict[str, ast.Module]:
    """Every module of bench, methods and datasets, by its path from the root."""
    paths = sorted(path for folder in ("bench", *ALLOWED) for path in (ROOT / folder).rglob("*.py"))
    return {str(path.relative_to(ROOT)): ast.parse(path.read_text(encoding="utf-8")) for path in paths}


def imported(tree: ast.Module, path: str) -> Iterator[tuple[int, str, bool]]:
    """Line and full name of what a module takes from the project, wherever in it; whether by a relative import."""
    package = [*(["bench"] if Path(path).parts[0] in ALLOWED else []), *Path(path).parent.parts]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name, False) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{module}.{alias.name}", node.level > 0) for alias in node.names)
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) == "bench" and node.attr in bench.__all__:
            yield node.lineno, f"bench.{node.attr}", False


def upward(tree: ast.Module, path: str) -> list[str]:
    """Imports that a module must not have."""
    folder, *rest = Path(path).parts
    own = rest[0].removesuffix(".py")
    found = []
    for line, name, relative in imported(tree, path):
        top, target, *_ = *name.split("."), ""
        if top != "bench" or not target:
            continue
        if folder in ALLOWED:
            wrong = target not in {*bench.__all__, *ALLOWED[folder]} and not (target == folder and relative)
        elif own == "__init__":  # the door names the homes of what it offers, for type checkers
            wrong = False
        else:
            wrong = target != own and RANK.get(target, len(ORDER)) >= RANK[own] and target != "__version__"
        if wrong:
            found.append(f"{path}:{line}: {name}")
    return found


@pytest.mark.parametrize("folder", ["bench", *ALLOWED])
def test_imports_point_downward(folder: str) -> None:
    own = {path: tree for path, tree in sources().items() if path.startswith(f"{folder}/")}
    assert len(own) > 5
    assert [found for path, tree in own.items() for found in upward(tree, path)] == []


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("bench/core/x.py", "from bench.plugins import catalog"),
        ("bench/plugins/x.py", "import bench.formats.npz"),
        ("bench/scoring/metrics/x.py", "def f():\n    from ...reporting.tables import grid"),
        ("bench/suite/x.py", "from bench.methods.spectral import Spectral"),
        ("bench/running/x.py", "from bench import solve"),
        ("bench/running/x.py", "import bench\nx = bench.solve"),
        ("methods/x.py", "from bench.core.so3 import exp"),
        ("methods/x.py", "from bench.methods._lib.graph import starts"),
        ("methods/_lib/graph/x.py", "from bench.formats.npz import read_npz"),
        ("methods/x.py", "from bench.datasets.folded import Folded"),
        ("datasets/x.py", "from bench.storage.store import Store"),
    ],
)
def test_an_import_that_points_upward_is_found(path: str, source: str) -> None:
    assert len(upward(ast.parse(source), path)) == 1


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("bench/scoring/x.py", "import numpy\nfrom bench.core import so3\nfrom .metrics import errors"),
        ("bench/cli/x.py", "import bench\nfrom bench import __version__\nfrom bench.api import run"),
        ("methods/x.py", "from bench import Problem, method, so3\nfrom ._lib.graph import starts"),
        ("datasets/_files/x.py", "from bench.formats import read_graph\nfrom ..folded import Folded"),
    ],
)
def test_one_that_points_downward_is_not(path: str, source: str) -> None:
    assert upward(ast.parse(source), path) == []


def constants(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Texts in a module that are no docstrings."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    bodies = [node.body for node in ast.walk(tree) if isinstance(node, documented)]
    docstrings = {id(body[0].value) for body in bodies if body and isinstance(body[0], ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.lineno, node.value


def plugins_named(tree: ast.Module, names: set[str]) -> list[tuple[int, str]]:
    """Texts that are the name of a plug-in, or a selection of one; a name inside a sentence is an example."""
    return [(line, text) for line, text in constants(tree) if re.sub(r"\[\S*\Z", "", text) in names]


def test_the_harness_names_no_method_and_no_dataset() -> None:
    names = {info.name for kind in ("method", "dataset") for info in catalog(kind)}  # type: ignore[call-overload]
    assert {"spectral", "1dsfm"} <= names
    harness = {path: tree for path, tree in sources().items() if path.startswith("bench/")}
    assert [f"{path}:{line}: {t!r}" for path, tree in harness.items() for line, t in plugins_named(tree, names)] == []


def test_a_name_is_found_and_an_example_is_not() -> None:
    source = (
        "'''spectral'''\nhelp = 'such as spectral[normalised=true]'\nnamed = ['spectral', 'gnc[a=1]', f'gnc[a={x}]']\n"
    )
    found = plugins_named(ast.parse(source), {"spectral", "gnc"})
    assert found == [(3, "spectral"), (3, "gnc[a=1]"), (3, "gnc[a=")]


@pytest.mark.parametrize("kind", ["method", "dataset"])
def test_every_plugin_has_a_test_that_names_it(kind: str) -> None:
    """`test_conformance` runs every method; what is particular to one is tested where its module is imported."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").glob("test_*.py"))
    infos = list(catalog(kind))  # type: ignore[call-overload]
    assert infos
    assert [i.name for i in infos if f"{kind}s.{i.cls.__module__.rsplit('.', 1)[-1]} import" not in text] == []


def test_the_root_of_bench_has_few_modules() -> None:
    assert len(list((ROOT / "bench").glob("*.py"))) <= 8


def test_no_file_is_long() -> None:
    lengths = Counter({path: len((ROOT / path).read_text(encoding="utf-8").splitlines()) for path in sources()})
    assert [item for item in lengths.most_common() if item[1] > 400] == []


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="this is not a git checkout")
def test_the_readme_names_everything_at_the_top() -> None:
    """But for what is git's own: no file is left lying at the top."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    tracked = {path.split("/")[0] for path in listed.splitlines() if not path.startswith(".git")}
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert tracked - top_names(readme) == set()


def top_names(readme: str) -> set[str]:
    """What the first fenced block under "Where things are" names at the start of its lines."""
    section = readme.partition("\n## Where things are\n")[2]
    block = re.search(r"^```\w*\n(.*?)^```", section, re.MULTILINE | re.DOTALL)
    assert block, "README.md has no tree under '## Where things are'"
    heads = [re.split(r"\s{2,}|\s#", line)[0] for line in block[1].splitlines() if line[:1].strip()]
    return {name.strip(",").split("/")[0] for head in heads for name in head.split()}


def test_names_at_the_top_are_read_from_the_tree() -> None:
    tree = "# X\n\n## Where things are\n\n```\nbench/core/   what results are\n    x.py\na.md, b.md  # c.md\n```\n"
    assert top_names(tree) == {"bench", "a.md", "b.md"}


PAGES = [
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md")),
]


@pytest.mark.parametrize("page", PAGES)
def test_every_path_that_a_page_names_is_there(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    named = set(re.findall(r"`((?:bench|methods|datasets|results|tests|docs)/[\w./-]*)`", text))
    assert len(named) > 1 or page not in ("README.md", "CONTRIBUTING.md")
    assert {path for path in named if not (ROOT / path).exists()} - {"results/runs/"} == set()
