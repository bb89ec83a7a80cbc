"""Discovery and configuration of plug-ins."""

import subprocess
import sys
from pathlib import Path

import pytest

from bench.core.errors import InputError
from bench.plugins.catalog import catalog

HEADER = "from dataclasses import dataclass\nfrom typing import Literal\nfrom bench import method\n"


def write(path: Path, name: str, body: str = "", requires: str = "()") -> Path:
    path.write_text(
        f"{HEADER}\n@method({name!r}, title='T', requires={requires})\n@dataclass(frozen=True)\nclass M:\n"
        f"    '''Does nothing.'''\n    depth: int = 2\n    rate: float = 0.5\n    loss: Literal['l1', 'l2'] = 'l1'\n"
        f"    width: int | None = None\n{body}\n    def solve(self, problem, rng): ...\n"
    )
    return path


def test_a_plugin_file_is_found_and_configured(tmp_path: Path) -> None:
    info = catalog("method", [write(tmp_path / "mine.py", "mine")])["mine"]
    assert info.summary == "Does nothing."
    assert info.defaults() == {"depth": 2, "rate": 0.5, "loss": "l1", "width": None}
    assert info.configure({"rate": 1, "width": 3}).rate == 1.0


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"dept": 1}, "has no parameter 'dept'; did you mean 'depth'"),
        ({"depth": 1.5}, "'depth' of method 'mine' must be a whole number, not 1.5"),
        ({"depth": True}, "must be a whole number, not True"),
        ({"loss": "l3"}, "must be 'l1' or 'l2', not 'l3'"),
        ({"width": "wide"}, "must be a whole number or none, not 'wide'"),
    ],
)
def test_bad_parameters_are_one_sentence(tmp_path: Path, parameters: dict[str, object], sentence: str) -> None:
    info = catalog("method", [write(tmp_path / "mine.py", "mine")])["mine"]
    with pytest.raises(InputError, match=sentence):
        info.configure(parameters)


def test_a_range_check_of_the_plugin_reaches_the_user(tmp_path: Path) -> None:
    body = "    def __post_init__(self):\n        if self.depth < 1: raise ValueError('depth must be at least 1')"
    info = catalog("method", [write(tmp_path / "mine.py", "mine", body)])["mine"]
    with pytest.raises(InputError, match="method 'mine': depth must be at least 1"):
        info.configure({"depth": 0})


@pytest.mark.parametrize("broken", ["import nowhere_at_all", "def (", "raise SystemError('no')", "1 / 0"])
def test_a_broken_plugin_is_listed_with_its_reason(tmp_path: Path, broken: str) -> None:
    path = tmp_path / "broken_one.py"
    path.write_text(broken)
    found = catalog("method", [path])
    assert list(found.broken) == [str(path)]
    with pytest.raises(InputError, match="method 'broken-one' is broken"):
        found["broken-one"]


def test_two_plugins_of_one_name_are_an_error(tmp_path: Path) -> None:
    paths = [write(tmp_path / f"{k}.py", "mine") for k in "ab"]
    with pytest.raises(InputError, match="two methods are called 'mine'"):
        catalog("method", paths)


def test_unknown_names_get_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no method 'spectrall'; did you mean 'spectral'"):
        catalog("method")["spectrall"]


def test_missing_packages_are_seen_without_importing(tmp_path: Path) -> None:
    info = catalog("method", [write(tmp_path / "mine.py", "mine", requires="('numpy', 'not_there')")])["mine"]
    assert info.not_installed() == ("not_there",)
    assert info.install_hint() == "python -m pip install not_there"


@pytest.mark.parametrize(
    ("declaration", "reason"),
    [
        ("class M:\n    def solve(self, problem, rng): ...", "put @dataclass"),
        ("@dataclass(frozen=True)\nclass M:\n    x: int = 1", "no method called solve"),
        ("@dataclass\nclass M:\n    x: int = 1\n    def solve(self, problem, rng): ...", "put @dataclass(frozen=True)"),
        (
            "@dataclass(frozen=True)\nclass M:\n    x: int\n    def solve(self, problem, rng): ...",
            "'x' needs a default",
        ),
    ],
)
def test_a_wrong_declaration_says_what_to_do(tmp_path: Path, declaration: str, reason: str) -> None:
    path = tmp_path / "wrong.py"
    path.write_text(f"{HEADER}\n@method('wrong', title='T')\n{declaration}\n")
    why = catalog("method", [path]).broken[str(path)]
    assert why.startswith(f"{path}:5: TypeError: ")
    assert reason in why


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("def f(", "SyntaxError: '(' was never closed"),
        ("import nowhere_at_all.deep", "requires=('nowhere_at_all',)"),
        ("x = np.eye(3)", "NameError: name 'np' is not defined; import or define it"),
    ],
)
def test_a_broken_plugin_is_named_with_its_line_whatever_it_is_asked_for(
    tmp_path: Path, line: str, reason: str
) -> None:
    path = tmp_path / "mine.py"
    path.write_text(f"{HEADER}\n{line}\n")
    with pytest.raises(InputError) as refused:
        catalog("method", [path])["another-name"]
    assert f"a plug-in is broken: {path}:5: " in str(refused.value)
    assert reason in str(refused.value)


def test_the_line_of_a_module_beside_the_plugin_is_named(tmp_path: Path) -> None:
    (tmp_path / "beside_the_plugin.py").write_text("\n\n1 / 0\n")
    path = tmp_path / "mine.py"
    path.write_text("import sys\nsys.path.insert(0, __file__[:-8])\nimport beside_the_plugin\n")
    why = catalog("method", [path]).broken[str(path)]
    assert why == f"{tmp_path}/beside_the_plugin.py:3: ZeroDivisionError: division by zero"


def test_a_grid_gives_each_configuration_once(tmp_path: Path) -> None:
    found = catalog("method", [write(tmp_path / "mine.py", "mine")])
    chosen = found.select(["mine[depth=[2,3]]", "mine", "mine[depth=3,loss=l1]"])
    assert [parameters for _, parameters in chosen] == [{"depth": 2}, {"depth": 3}]


def test_source_hash_follows_the_siblings_that_a_module_uses() -> None:
    found = catalog("method")
    hashes = {info.name: info.source_hash for info in found}
    assert len(set(hashes.values())) == len(hashes)


def test_every_built_in_plugin_imports() -> None:
    for kind in ("method", "dataset"):
        assert catalog(kind).broken == {}


def test_listing_imports_nothing_heavy() -> None:
    heavy = ("scipy", "torch", "gtsam", "cvxpy", "pycolmap", "numba", "pandas", "matplotlib", "pooch")
    code = (
        "import sys; from bench import catalog; [catalog(k) for k in ('method', 'dataset')]; "
        f"print([m for m in {heavy!r} if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "[]"
