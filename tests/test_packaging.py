"""The wheel and the sdist: built, installed into an empty environment, and used outside and inside a checkout."""

import os
import subprocess
import sys
import sysconfig
import tarfile
import venv
from pathlib import Path

import pytest

import bench

ROOT = Path(__file__).parent.parent
SMALL = ("run", "-m", "spectral", "-d", "erdos-renyi[n=8,missing=0.2]")


def run(*command: object, cwd: Path) -> str:
    own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run([*map(str, command)], cwd=cwd, env=own, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "hatchling", "build", "-d", folder, cwd=ROOT)
    return folder


@pytest.fixture(scope="module")
def scripts(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the commands of an environment that has the wheel; its dependencies are those of this one."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home)
    folder = Path(sysconfig.get_path("scripts", "venv", {"base": str(home), "platbase": str(home)}))
    (wheel,) = built.glob("*.whl")
    python = folder / "python"
    run(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", wheel, cwd=home)
    site = run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=home).strip()
    Path(site, "surrounding.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")
    return folder


@pytest.mark.parametrize("inside", [False, True], ids=["outside", "inside a checkout"])
@pytest.mark.parametrize("command", [("python", "-m", "bench"), ("rotsync-bench",)], ids=["module", "script"])
def test_the_wheel_lists_and_runs(command: tuple[str, ...], inside: bool, scripts: Path, tmp_path: Path) -> None:
    command = (str(scripts / command[0]), *command[1:])
    where = ROOT if inside else tmp_path
    methods = run(*command, "list", "methods", cwd=where)
    assert "spectral" in methods
    assert "broken" not in methods
    assert "table1" in run(*command, "list", "papers", cwd=where)
    assert "report.html" in run(*command, *SMALL, "--out", tmp_path / "run", cwd=where)
    assert (tmp_path / "run" / "report.html").stat().st_size > 100_000


def test_every_source_is_in_the_wheel(built: Path, scripts: Path) -> None:
    listed = "import bench, pathlib; root = pathlib.Path(bench.__file__).parent; print(*root.rglob('*'), sep='\\n')"
    installed = run(scripts / "python", "-c", listed, cwd=built)
    files = {path for path in installed.splitlines() if not path.endswith((".pyc", ".nbi", ".nbc"))}
    for folder, home in (("bench", ""), ("methods", "methods/"), ("datasets", "datasets/")):
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in (".py", ".toml", ".html", ".js", ".css", ".bib", ".typed"):
                assert any(f.endswith(f"bench/{home}{path.relative_to(ROOT / folder)}") for f in files), path


def test_the_sdist_runs_its_own_tests(built: Path, tmp_path: Path) -> None:
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(
            tmp_path, **({"filter": "data"} if hasattr(tarfile, "data_filter") else {})
        )  # from 3.11.4 on
    (root,) = tmp_path.iterdir()
    pytest_here = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-W", "error")
    assert "error" not in run(*pytest_here, "--collect-only", cwd=root).splitlines()[-1]
    assert "passed" in run(*pytest_here, "tests/test_so3.py", "tests/test_plugins.py", cwd=root)


def test_the_version_has_one_place(scripts: Path) -> None:
    shown = "from importlib.metadata import version; print(version('rotsync-bench'))"
    assert run(scripts / "python", "-c", shown, cwd=scripts).strip() == bench.__version__


@pytest.mark.parametrize("folder", ["methods", "datasets"])
def test_a_folder_of_plugins_has_one_name(folder: str) -> None:
    done = subprocess.run([sys.executable, "-c", f"import {folder}"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 1
    assert f"this folder is bench.{folder}" in done.stderr.splitlines()[-1]


def test_two_checkouts_do_not_mix(tmp_path: Path) -> None:
    """A second checkout in the working folder is used whole, whichever one is installed."""
    for folder in ("bench", "methods", "datasets"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    code = "import bench, bench.methods, bench.datasets as d; print(bench.__file__, bench.methods.__file__, d.__file__)"
    paths = run(sys.executable, "-c", code, cwd=tmp_path).split()
    assert [Path(path).parent.parent for path in paths] == [tmp_path] * 3


def test_the_door_is_all_there_is() -> None:
    assert dir(bench) == sorted(bench.__all__)
    assert all(getattr(bench, name) is not None for name in bench.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        bench.nothing  # noqa: B018
