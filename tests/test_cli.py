"""The command line, run as a user runs it."""

import csv
import io
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from commands import bench

from bench import __version__
from bench.api import run
from bench.core.errors import InputError
from bench.plugins.catalog import catalog
from bench.plugins.selection import format_parameters
from bench.running.run import Options, Run

COLUMNS = [
    "dataset",
    "instance",
    "method",
    "params",
    "seed",
    "protocol",
    "alignment",
    "outcome",
    "status",
    "mean_deg",
    "median_deg",
    "solve_s",
    "peak_mib",
    "n_cameras",
    "n_solved",
    "n_scored",
]
SMALL = ("-m", "spanning-tree", "-m", "l1-irls", "-d", "erdos-renyi[n=15,missing=0.2]")


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def sentence(done: subprocess.CompletedProcess[str]) -> str:
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr.strip()


def test_a_run_says_where_its_tables_and_plots_are(tmp_path: Path) -> None:
    out = tmp_path / "run"
    done = bench("run", *SMALL, "--out", out)
    assert f"tables: {out}/tables" in done.stdout
    assert f"plots:  {out}/plots" in done.stdout
    assert {p.suffix for p in (out / "tables").iterdir()} == {".txt", ".md", ".csv", ".tex"}
    assert {p.suffix for p in (out / "plots").iterdir()} == {".png", ".pdf", ".svg"}

    again = bench("run", *SMALL, "--out", out)
    assert "2 jobs on 1 instance, 2 of them done already" in again.stdout

    table = bench("table", out, "--format", "csv")
    found = rows(table.stdout)
    assert [row["method"] for row in found] == ["spanning-tree", "l1-irls"]
    assert list(found[0])[: len(COLUMNS)] == COLUMNS
    assert all(row["status"] == "ok" and float(row["mean_deg"]) < 120 for row in found)


def test_another_alignment_runs_nothing(tmp_path: Path) -> None:
    run(methods=["spanning-tree", "l1-irls"], datasets=["erdos-renyi[n=15,missing=0.2]"], out=tmp_path)
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "records").rglob("*.json")}
    assert before
    for rule in ("chordal", "karcher", "anchors"):
        found = rows(bench("table", tmp_path, "--align", rule, "--format", "csv").stdout)
        assert {row["alignment"] for row in found} == {rule}
    assert before == {p: p.stat().st_mtime_ns for p in (tmp_path / "records").rglob("*.json")}


def test_ctrl_c_then_the_same_command_continues(faulty_plugin: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    command = [
        "run",
        "-m",
        f"faulty[fault=gate,mark={tmp_path / 'gate'}]",  # only the first two instances are solved while it is closed
        "-d",
        "toy[n=[3,4,5,6,7,8]]",
        "--plugin",
        faulty_plugin,
        "--out",
        out,
    ]
    running = subprocess.Popen(
        [sys.executable, "-m", "bench", *map(str, command), "--jobs", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )
    deadline = time.monotonic() + 60
    while len(list(out.glob("records/*/*.json"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    _, errors = running.communicate(timeout=30)
    assert running.returncode == 130
    assert "the same command continues" in errors
    assert "Traceback" not in errors
    done = {p.name: p.stat().st_mtime_ns for p in out.glob("records/*/*.json")}
    assert len(done) == 2

    (tmp_path / "gate.open").touch()
    bench(*command)
    after = {p.name: p.stat().st_mtime_ns for p in out.glob("records/*/*.json")}
    assert len(after) == 6
    assert done.items() <= after.items()


def test_dry_run_writes_nothing(tmp_path: Path) -> None:
    done = bench("run", *SMALL, "--out", tmp_path / "run", "--dry-run")
    assert done.stdout.count("to run") == 2
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "--suite", "qick"), "there is no suite 'qick'; did you mean 'quick'?"),
        (("run", "-m", "spectrl"), "there is no method 'spectrl'; did you mean 'spectral'?"),
        (("run", "-m", "spectral[normalized=true]"), "did you mean 'normalised'?"),
        (("run", "-m", "spectral[normalised=maybe]"), "must be true or false, not 'maybe'"),
        (("run", "-m", "spectral["), "cannot read the selection 'spectral['"),
        (("run", "-d", "erdos-renyi[n=1]"), "must be at least 2 and at most 30000, not 1"),
        (("run", "-d", "1dsfm", "--protocol", "componnt"), "must be 'truth-subgraph' or 'component', not 'componnt'"),
        (("run", "-d", "1dsfm[scene=Elis_Island]"), "did you mean 'Ellis_Island'?"),
        (("run", "--data-dir", "nowhere"), "nowhere"),
        (("table", "nowhere"), "nowhere is not the folder of a run"),
        (("solve", "nowhere.g2o", "-m", "spectral", "-o", "x.npz"), "nowhere.g2o: there is no such file"),
        (("check", "method", "spectral", "--plugin", "nowhere.py"), "there is no such Python file"),
        (("new", "method", "My Method"), "is not a name for a method"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    done = bench(*arguments, code=2, cwd=tmp_path)
    assert message in sentence(done)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("edges", "message"),
    [
        ("", "EGs.txt: the file is empty"),
        ("0 1 1 0 0 0 1 0 0 0 1 0 0\n", "EGs.txt:1: 13 values"),
        ("0 1 1 0 0 0 1 0 0 0 nan 0 0 0\n", "EGs.txt:1: the rotation holds NaN"),
        ("0 1 1 0 0 0 1 0 0 0 -1 0 0 0\n", "EGs.txt:1: the matrix is a reflection"),
        ("0 0 1 0 0 0 1 0 0 0 1 0 0 0\n", "EGs.txt:1: an edge from camera 0 to itself"),
        ("0 x 1 0 0 0 1 0 0 0 1 0 0 0\n", "EGs.txt:1: 'x' is not a camera id"),
    ],
)
def test_a_malformed_scene_names_file_and_line(tmp_path: Path, edges: str, message: str) -> None:
    scene = tmp_path / "data" / "Scene"
    scene.mkdir(parents=True)
    (scene / "EGs.txt").write_text(edges)
    out = tmp_path / "run"
    run = bench(
        "run",
        "-m",
        "spectral",
        "-d",
        "1dsfm[scene=Scene]",
        "--data-dir",
        tmp_path / "data",
        "--out",
        out,
        code=2,
    )
    assert message in sentence(run)
    assert not list(out.rglob("*.json"))
    solve = bench("solve", scene, "-m", "spectral", "-o", tmp_path / "out.npz", code=2)
    assert message in sentence(solve)
    assert not (tmp_path / "out.npz").exists()


def test_solve_writes_rotations_with_the_file_s_own_ids(tmp_path: Path) -> None:
    turn = "0 -1 0 1 0 0 0 0 1"
    (tmp_path / "EGs.txt").write_text(f"7 11 {turn} 0 0 0\n11 30 {turn} 0 0 0\n")
    out = tmp_path / "rotations.npz"
    done = bench("solve", tmp_path / "EGs.txt", "-m", "spectral", "-o", out)
    assert "3 cameras, 2 edges" in done.stdout
    with np.load(out) as data:
        assert data["cameras"].tolist() == [7, 11, 30]
        first, second = data["rotations"][:2]
    np.testing.assert_allclose(first @ second.T, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-9)


def test_a_plugin_of_one_file_is_listed_checked_and_run(tmp_path: Path) -> None:
    bench("new", "method", "my-method", "--into", tmp_path)
    path = tmp_path / "my_method.py"
    assert len(path.read_text().splitlines()) <= 36
    assert re.search(r"^my-method", bench("list", "methods", "--plugin", path).stdout, re.MULTILINE)
    assert "fit to be benchmarked" in bench("check", "method", "my-method", "--plugin", path).stdout
    run = ("run", "--plugin", path, "-d", "erdos-renyi[n=15,missing=0.2]", "-m", "my-method", "-m", "l1-irls")
    bench(*run, "--out", tmp_path / "run")
    found = rows(bench("table", tmp_path / "run", "--format", "csv").stdout)
    assert {row["method"]: row["status"] for row in found} == {"my-method": "ok", "l1-irls": "ok"}
    assert "exists already" in sentence(bench("new", "method", "my-method", "--into", tmp_path, code=2))


def test_a_plugin_joins_the_suite_when_no_methods_are_named(faulty_plugin: Path, tmp_path: Path) -> None:
    done = bench("run", "--plugin", faulty_plugin, "--out", tmp_path / "run", "--dry-run")
    assert "faulty" in done.stdout
    assert "l1-irls" in done.stdout


def test_a_bare_method_is_its_default_and_a_bare_dataset_what_the_suite_has_of_it(tmp_path: Path) -> None:
    def chosen(*methods: str) -> set[tuple[str, str]]:
        jobs = [cell.job for cell in Run("quick", methods, ["erdos-renyi"], Options(out=tmp_path)).cells]
        assert {job.instance for job in jobs} == {"n40-missing0.5", "n100-missing0.5", "n100-missing0.8"}
        return {(job.method, format_parameters(job.parameters)) for job in jobs}

    assert chosen("spectral") == {("spectral", "")}
    assert chosen("spectral[normalised=false]", "shonan") == {("spectral", "normalised=false"), ("shonan", "")}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"methods": "l1-irls"}, r"methods takes a list of selections, such as \['l1-irls'\], not 'l1-irls' alone"),
        ({"datasets": "folded"}, "datasets takes a list"),
        ({"seed": 3}, "run takes no 'seed'; did you mean 'seeds'?"),
        ({"colour": "red"}, "run takes no 'colour'; there are: data_dir, engine"),
    ],
)
def test_misuse_from_python_is_one_sentence(tmp_path: Path, given: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        run("quick", **{"out": tmp_path / "run"} | given)  # type: ignore[arg-type]
    assert not (tmp_path / "run").exists()


def test_a_broken_plugin_is_listed_as_broken(tmp_path: Path) -> None:
    path = tmp_path / "broken.py"
    path.write_text("import no_such_package\n")
    assert f"broken: {path}:1: ModuleNotFoundError" in bench("list", "methods", "--plugin", path).stdout


def test_check_fails_with_exit_code_1(faulty_plugin: Path) -> None:
    done = bench("check", "method", "faulty", "--plugin", faulty_plugin, code=1)
    assert "failed   triangle" in done.stdout


def test_lists_and_help_import_nothing_heavy() -> None:
    heavy = ("numpy", "scipy", "torch", "gtsam", "cvxpy", "pycolmap", "numba", "pandas", "matplotlib")
    code = (
        "import sys\nfrom bench.cli import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit:\n    pass\n"
        f"sys.exit(str([m for m in {heavy!r} if m in sys.modules]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stderr.strip() == "[]"


def test_the_version_is_said() -> None:
    assert bench("--version").stdout == f"rotsync-bench {__version__}\n"


@pytest.fixture
def script(tmp_path: Path) -> Path:
    """The console script, as an installation makes it."""
    path = tmp_path / "bin" / "rotsync-bench"
    path.parent.mkdir()
    path.write_text("from bench.cli import main\n\nmain()\n")
    return path


def started(*command: object, **environment: str) -> subprocess.CompletedProcess[str]:
    done = [sys.executable, *map(str, command)]
    return subprocess.run(done, capture_output=True, text=True, env=os.environ | environment, timeout=60)


def test_the_program_is_called_as_the_user_started_it(script: Path) -> None:
    for start, name in ((("-m", "bench"), "python -m bench"), ((script,), "rotsync-bench")):
        assert f"Usage: {name} run" in started(*start, "run", "--help").stdout
        assert f"make one with: {name} run --out nowhere" in started(*start, "table", "nowhere").stderr


def test_completion_is_for_the_script_however_it_was_asked_for(script: Path) -> None:
    for start in (("-m", "bench"), (script,)):
        shown = started(*start, "--show-completion", "bash", _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1").stdout
        assert "complete -o default -F _rotsync_bench_completion rotsync-bench" in shown
        assert "_ROTSYNC_BENCH_COMPLETE=complete_bash" in shown
        assert "_PYTHON" not in shown
        words = {"COMP_WORDS": "rotsync-bench comp", "COMP_CWORD": "1", "_ROTSYNC_BENCH_COMPLETE": "complete_bash"}
        assert started(*start, **words).stdout.split() == ["compare"]


def test_data_lists_every_dataset_where_none_is_named(tmp_path: Path) -> None:
    listed = bench("data", "list", "--data-dir", tmp_path).stdout.splitlines()
    assert {line.split()[1].split("/")[0] for line in listed} == set(catalog("dataset").entries) - {"files"}
    assert sum(line.startswith("missing") and "python -m bench data fetch 1dsfm" in line for line in listed) == 15


def test_data_lists_what_is_missing_with_the_command(tmp_path: Path) -> None:
    done = bench("data", "list", "1dsfm", "--data-dir", tmp_path)
    assert done.stdout.count("python -m bench data fetch 1dsfm") == 15
