"""Style files: what they change, and what they may say."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from appearances import using
from commands import bench

from bench.core.errors import InputError
from bench.reporting import appearance
from bench.reporting.appearance import Appearance, MethodLook, find, read
from bench.reporting.figures import style
from bench.reporting.figures.looks import looks
from bench.reporting.tables.grid import grids
from bench.scoring.metrics.errors import summary

STYLE = """
width = "double"
font = "DejaVu Serif"
font_size = 7
colors = ["#111111", "#222222"]
order = ["b[k=2]", "a"]

[methods.a]
name = "First"
marker = "s"

[methods."b[k=2]"]
name = "Second"
color = "red"
line = ":"
"""


@pytest.fixture
def frame() -> pd.DataFrame:
    rows = []
    for instance in ("s", "t"):
        for method, params in (("a", ""), ("a", "k=1"), ("b", "k=2"), ("b", "")):
            row = {"dataset": "d", "instance": instance, "instance_key": instance, "protocol": "all", "alignment": "l1"}
            row |= {
                "method": method,
                "title": method.upper(),
                "params": params,
                "seed": 0,
                "outcome": "ok",
                "status": "ok",
                "notes": "",
            }
            row |= {"n_cameras": 9, "n_solved": 9, "solve_s": 1.0, "peak_mib": 1.0}
            rows.append(row | summary(np.arange(1.0, 10)))
    return pd.DataFrame(rows)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(STYLE)
    return path


def test_what_a_file_says(file: Path) -> None:
    assert read(file) == Appearance(
        width_in=7.16,
        font="DejaVu Serif",
        font_size=7,
        colors=("#111111", "#222222"),
        order=("b[k=2]", "a"),
        methods={
            "a": MethodLook(name="First", marker="s"),
            "b[k=2]": MethodLook(name="Second", color="red", line=":"),
        },
    )


def test_tables_and_figures_follow_it(file: Path, frame: pd.DataFrame) -> None:
    with using(read(file)):
        ordered = appearance.current().ordered(frame)
        (grid,) = grids(ordered, {})
        shown = looks(ordered)
        with style.styled():
            figure, _ = style.panels(1, 2.0, 2.0, ())
    assert grid.methods == (("Second", ""), ("First", ""), ("First", "k=1"), ("B", ""))
    assert [facts[0] for facts, _ in grid.rows] == ["s", "t"]
    assert shown["b", "k=2"].color == "red"
    assert shown["b", "k=2"].line == ":"
    assert (shown["a", ""].label, shown["a", ""].marker, shown["a", ""].color) == ("First", "s", "#222222")
    assert figure.get_figwidth() == 7.16
    assert looks(frame)["a", ""].label == "A"  # no longer in force


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("fnt = 'x'", "unknown key 'fnt'; did you mean 'font'"),
        ("[methods.a]\ncolour = 'red'", "methods.a: unknown key 'colour'; did you mean 'color'"),
        ("width = 'triple'", 'width must be "single", "double" or 2 to 30 inches, not \'triple\''),
        ("width = true", "width must be"),
        ("width = nan", "width must be"),
        ("font_size = 100", "font_size must be from 3 to 30 points, not 100"),
        ("font = 'Comic Sanz'", "font must be an installed font, not 'Comic Sanz'|did you mean"),
        ("font = 3", "font must be text, not 3"),
        ("colors = ['no colour']", "colors must be a colour"),
        ("colors = 'red'", "colors must be a list"),
        ("order = [1]", r"order\[0\] must be text, not 1"),
        ("methods = 3", "methods must be a table"),
        ("[methods]\na = 3", "methods.a must be a table"),
        ("[methods.a]\nname = 3", "methods.a.name must be text, not 3"),
        ("[methods.a]\nmarker = 'Q'", "marker must be one of matplotlib's markers"),
        ("[methods.a]\nline = 'dashy'", "line must be one of matplotlib's line styles"),
        ("[methods.a]\ncolor = 'nope'", "color must be a colour"),
        ("width = ", "is not valid TOML"),
    ],
)
def test_what_cannot_be_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read(path)


def test_a_missing_file_is_an_error_and_none_is_the_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert find() == (Appearance(), None)
    with pytest.raises(InputError, match="cannot be read"):
        find(tmp_path / "none.toml")


def test_the_file_of_the_working_folder_persists(tmp_path: Path, file: Path) -> None:
    run = tmp_path / "run"
    work = tmp_path / "work"
    work.mkdir()
    bench("run", "-m", "spanning-tree", "-m", "l1-irls", "-d", "erdos-renyi[n=12]", "--out", run, cwd=work)
    (work / "bench-style.toml").write_text('order = ["l1-irls"]\n[methods.l1-irls]\nname = "Mine"\n')
    done = bench("table", run, "--format", "markdown", cwd=work)
    assert done.stderr.splitlines()[0] == "style: bench-style.toml"
    assert "| Mine | Spanning tree |" in done.stdout
    other = bench("table", run, "--format", "latex", "--style", file, cwd=work)
    assert other.stderr.splitlines()[0] == f"style: {file}"
    assert "Mine" not in other.stdout
    shown = bench("table", run, cwd=work).stdout
    assert shown.index(" Mine ") < shown.index(" spanning-tree ")
    assert "l1-irls" not in shown
    page = Path(bench("report", run, "--out", tmp_path / "r.html", cwd=work).stdout.strip()).read_text()
    assert "Mine" in page
    assert "Mine" not in Path(bench("report", run, "--style", file, cwd=work).stdout.strip()).read_text()
    refused = bench("run", "-m", "spanning-tree", "--style", "none.toml", "--out", tmp_path / "no", cwd=work, code=2)
    assert "cannot be read" in refused.stderr
    assert not (tmp_path / "no").exists()
    drawn = bench("plot", run, "--width", "single", "--out", tmp_path / "plots", cwd=work)
    assert "captions.tex" in drawn.stdout
    assert b"Mine" in (tmp_path / "plots" / "cumulative-errors.svg").read_bytes()
    assert "unknown key" in bench("table", run, "--style", _bad(tmp_path), cwd=work, code=2).stderr


def _bad(folder: Path) -> Path:
    (folder / "bad.toml").write_text("colour = 3")
    return folder / "bad.toml"


def test_what_a_method_is_called() -> None:
    looks = {"a": MethodLook("A"), "b[k=1]": MethodLook("B one"), "c": MethodLook("Same"), "d": MethodLook("Same")}
    wanted = Appearance(methods=looks)
    named = [wanted.called(*key) for key in (("a", ""), ("a", "k=2"), ("b", "k=1"), ("b", ""), ("c", ""), ("d", "k=1"))]
    assert named == ["A", "A[k=2]", "B one", "b", "Same (c)", "Same (d)[k=1]"]
