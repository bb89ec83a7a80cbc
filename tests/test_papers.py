"""Published tables and figures beside what is measured here."""

import csv
import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import bench
from scenes import write_scene

from bench.core.errors import InputError
from bench.papers.computed import Computed, Score
from bench.papers.kinds.curves.plot import CurvePlot
from bench.papers.kinds.properties import PropertyTable
from bench.papers.kinds.scenes.table import SceneTable
from bench.papers.layout import load_layout, paper_names
from bench.papers.published import methods_of, read_published
from bench.plugins.catalog import catalog

LAYOUT = """
title = "A paper"

[t]
kind = "scenes"
title = "Errors"
published = "t.csv"
dataset = "1dsfm[protocol=truth-subgraph]"
scene_parameter = "scene"
statistic = "median_deg"
alignment = "l1"
highlight_reference = "Ours"
highlight_deg = 0.5

[t.measured]
Ours = ["spectral", "spanning-tree"]
Theirs = []

[t.scenes]
"Ellis Island" = "Ellis_Island"
"Madrid Metropolis" = "Madrid_Metropolis"
"Alamo" = "Alamo"

[f]
kind = "curves"
title = "Curves"
dataset = "erdos-renyi[noise_deg=1,outliers=0.4]"
statistic = "mean_deg"
alignment = "l1"
seeds = 10
panel = { parameter = "n", label = "{} nodes", values = [12, 16] }
axis = { parameter = "missing", label = "missing", values = [0.2, 0.5] }

[[f.curves]]
label = "tree"
method = "spanning-tree"

[[f.curves]]
label = "clairvoyant"
method = "spectral"
dataset = { clairvoyant = true }
reference = true

[b]
kind = "curves"
title = "Bound"
dataset = "erdos-renyi[noise=langevin,missing=0,outliers=0.2]"
statistic = "rms_deg"
alignment = "chordal"
panel = { parameter = "n", label = "{} nodes", values = [40] }
axis = { parameter = "noise_deg", label = "noise", values = [2, 4] }

[[b.curves]]
label = "least squares"
method = "l1-irls[loss=l2]"
dataset = { clairvoyant = true }

[[b.curves]]
label = "spectral"
method = "spectral"

[[b.curves]]
label = "bound"
"""
PUBLISHED = """scene,n_cameras,edges_percent,hardness,Ours,Theirs,source
Ellis Island,9,50,0.1000,0.8,1.3,here
Madrid Metropolis,341,31,0.0029,2.3,1.7,here
Alamo,577,50,0.0017,1.2,,here
"""


@pytest.fixture
def layout_file(tmp_path: Path) -> Path:
    (tmp_path / "t.csv").write_text(PUBLISHED)
    path = tmp_path / "a-paper.toml"
    path.write_text(LAYOUT)
    return path


@pytest.mark.parametrize("name", paper_names())
def test_every_layout_that_ships_can_be_read_and_names_what_there_is(name: str) -> None:
    layout = load_layout(name)
    bibliography = (Path(__file__).parent.parent / "methods" / "references.bib").read_text()
    assert f"{{{layout.cite}," in bibliography
    methods, datasets = catalog("method"), catalog("dataset")
    for item in layout.items.values():
        for suite in item.suites(name):
            assert methods.select(suite.methods)
            assert datasets.select(suite.datasets)
        if isinstance(item, SceneTable):
            rows = read_published(layout.sources.published, item.published)
            frame = item.compare(layout.sources, Computed("l1")).frame()
            assert list(item.scenes) == [row["scene"] for row in rows]
            assert list(item.measured) == methods_of(rows)
            assert frame["measured"].isna().all()
        if isinstance(item, PropertyTable):
            frame = item.compare(layout.sources, Computed("")).frame()
            differing = frame[frame["agree"].eq(False)]  # ours of MSP is its graph part, which sees no images
            assert list(zip(differing["name"], differing["property"], strict=True)) == [("MSP", "raw images")]


def test_the_papers_highlights_follow_from_its_rule() -> None:
    layout = load_layout("dmf-synch-2023")
    table = layout.item("table1")
    assert isinstance(table, SceneTable)
    frame = table.compare(layout.sources, Computed("l1")).frame()
    near = frame[frame["near_published"]].groupby("quantity")["scene"].agg(set)
    assert near["PoGO-Net"] == {
        "Alamo", "Ellis Island", "Montreal Notre Dame", "Piazza del Popolo", "Vienna Cathedral",
    }  # fmt: skip
    assert near["NeuRoRA"] == near["PoGO-Net"] | {"Roman Forum"}
    assert set(table.scenes) - near["L1-IRLS"] == {"Gendarmenmarkt", "Madrid Metropolis"}
    assert "DMF-Synch" not in near


def scores(**medians: dict[str, float]) -> tuple[Score, ...]:
    return tuple(
        Score(
            "1dsfm",
            instance,
            method,
            status="ok" if np.isfinite(median) else "timeout",
            median_deg=median,
            n_cameras=9,
            edges_percent=60.5,
            hardness=0.25,
        )
        for instance, by_method in medians.items()
        for method, median in by_method.items()
    )


def test_differences_and_marks_are_those_worked_out_by_hand(layout_file: Path) -> None:
    layout = load_layout(str(layout_file))
    table = layout.item("t")
    assert isinstance(table, SceneTable)
    measured = scores(Ellis_Island={"spectral": 0.75, "spanning-tree": np.nan}, Madrid_Metropolis={"spectral": np.nan})
    notes = {"Ellis_Island": ("not the paper's cameras",)}
    computed = Computed("l1", scores=measured, notes=notes, missing=("get it with: fetch",))
    found = table.compare(layout.sources, computed)
    frame = found.frame()
    cells = frame.set_index(["instance", "quantity", "method"])
    assert cells.loc[("Ellis_Island", "Ours", "spectral"), "difference"] == pytest.approx(-0.05)
    assert cells.loc[("Ellis_Island", "edges_percent", ""), "difference"] == pytest.approx(10.5)
    assert cells.loc[("Ellis_Island", "Ours", "spanning-tree"), "status"] == "timeout"
    assert cells.loc[("Madrid_Metropolis", "Ours", "spanning-tree"), "status"] == "not-run"
    assert cells.loc[("Alamo", "Ours", "spectral"), "status"] == "not on disk"
    near = cells["near_published"].xs("Theirs", level="quantity").droplevel("method")
    assert near.to_dict() == {"Ellis_Island": True, "Madrid_Metropolis": False, "Alamo": False}

    text, _ = found.text("markdown")
    assert "| Ellis Island (a) | measured | 9 | 60.5 | 0.2500 | 0.75 | TO | – |" in text
    assert "|  | published | 9 | 50 | 0.1000 | 0.8 | 0.8 | **1.3** |" in text
    assert "|  | difference | 0 | +10.5 | +0.1500 | −0.05 |  |  |" in text
    assert "| Alamo | published | 577 | 50 | 0.0017 | 1.2 | 1.2 | – |" in text
    assert "(a) not the paper's cameras." in text
    assert "Theirs: published only" in text
    assert "Get it with: fetch." in text


def test_a_table_of_two_scenes_on_disk(layout_file: Path, tmp_path: Path) -> None:
    data = tmp_path / "data"
    write_scene(data / "Ellis_Island", images=12)
    write_scene(data / "Madrid_Metropolis", images=14, unregistered=(2, 5))
    command = ("paper", layout_file, "t", "--data-dir", data, "--out", tmp_path / "run")
    done = bench(*command, "--format", "csv")
    cells = {(r["scene"], r["quantity"], r["method"]): r for r in csv.DictReader(io.StringIO(done.stdout))}
    for method in ("spectral", "spanning-tree"):
        assert float(cells["Ellis Island", "Ours", method]["difference"]) == pytest.approx(-0.8, abs=0.01)
        assert float(cells["Madrid Metropolis", "Ours", method]["difference"]) == pytest.approx(-2.3, abs=0.01)
    assert float(cells["Ellis Island", "n_cameras", ""]["measured"]) == 10
    assert float(cells["Madrid Metropolis", "edges_percent", ""]["difference"]) == pytest.approx(69)
    assert cells["Ellis Island", "Theirs", ""]["status"] == "published only"
    assert "4 jobs, 0 of them done already" in done.stderr
    assert "alamo is not on disk; get it with: python -m bench data fetch" in done.stderr.lower().replace("1dsfm/", "")

    again = bench(*command, "--align", "chordal")
    assert "4 jobs, 4 of them done already" in again.stderr
    assert "chordal alignment" in again.stdout
    assert "(b) ground truth covers 11 of the 341 cameras" in " ".join(again.stdout.split())
    assert r"\begin{tabular}" in bench(*command, "--format", "latex").stdout


def test_a_table_without_any_scene_is_published_only(layout_file: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    done = bench("paper", layout_file, "t", "--data-dir", tmp_path / "empty", "--out", tmp_path / "run")
    assert done.stdout.count("published") >= 3
    assert "measured  " not in done.stdout
    assert "python -m bench data fetch 1dsfm" in done.stdout
    assert not (tmp_path / "run").exists()


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """A file with a method of one's own."""
    bench("new", "method", "mine", "--into", tmp_path)
    return tmp_path / "mine.py"


def test_a_method_of_ones_own_is_a_column_beside_the_papers(layout_file: Path, tmp_path: Path, mine: Path) -> None:
    data = tmp_path / "data"
    write_scene(data / "Ellis_Island", images=12)
    command = ("paper", layout_file, "t", "--data-dir", data, "--out", tmp_path / "run")
    own = ("-m", "mine[power=[1,2]]", "--plugin", mine)
    foreseen = bench(*command, *own, "--dry-run").stdout
    assert "to run  1dsfm[protocol=truth-subgraph,scene=Ellis_Island] Ellis_Island seed 0 mine[power=1.0]" in foreseen
    assert "missing: 2 instances of 1dsfm are not on disk" in foreseen
    assert "time: unknown" in foreseen
    assert not (tmp_path / "run").exists()

    done = bench(*command, *own, "--format", "csv")
    assert "4 jobs to run; time: unknown" in done.stderr
    rows = pd.read_csv(io.StringIO(done.stdout), keep_default_na=False)
    added = rows[(rows["quantity"] == "not in the paper") & (rows["scene"] == "Ellis Island")]
    assert added["method"].tolist() == ["mine[power=1.0]", "mine[power=2.0]"]
    assert (added["measured"].astype(float) < 0.1).all()
    assert (added["published"] == "").all()
    markdown = bench(*command, *own, "--format", "markdown").stdout.splitlines()[2]
    assert markdown.endswith("| Ours | Ours | Theirs | mine power=1.0 | mine power=2.0 |")
    latex = bench(*command, "--plugin", mine, "--format", "latex").stdout
    assert " mine " in latex
    assert "done" in bench(*command, *own, "--dry-run").stdout


def test_a_method_of_ones_own_is_a_curve(layout_file: Path, tmp_path: Path, mine: Path) -> None:
    command = ("paper", layout_file, "f", "-m", "mine", "--plugin", mine, "--seeds", 1, "--out", tmp_path / "run")
    points = pd.read_csv(io.StringIO(bench(*command, "--format", "csv").stdout))
    assert points["curve"].value_counts()["mine"] == 4
    assert points.loc[points["curve"] == "mine", "mean_deg"].notna().all()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("t", "-m", "mine"), "there is no method 'mine'"),
        (("t", "-m", "spectrl"), "did you mean 'spectral'"),
        (("t", "-m", "spectral[normalised=3]"), "parameter 'normalised' of method 'spectral' must be true or false"),
        (("t", "-m", "lie-averaging", "--data-dir", "empty"), "there is nothing to run: 3 instances of 1dsfm"),
        (("t", "--plugin", "none.py"), "--plugin 'none.py': there is no such Python file"),
        (("t", "--plugin", "broken.py"), "a plug-in is broken"),
        (("t", "-m", "lie-averaging", "--explain", "Ellis"), "leave out -m and --plugin"),
        (("u",), "paper a-paper has no 'u' here"),
    ],
)
def test_what_is_wrong_is_said_before_anything_runs(
    layout_file: Path, tmp_path: Path, arguments: tuple[str, ...], says: str
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken.py").write_text("1 / 0\n")
    done = bench("paper", layout_file, *arguments, code=2, cwd=tmp_path)
    assert says in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "results").exists()


def test_a_wrong_published_file_is_said_before_anything_runs(layout_file: Path, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(PUBLISHED.replace("Theirs", "Others"))
    write_scene(tmp_path / "data" / "Ellis_Island", images=12)
    done = bench("paper", layout_file, "t", "--data-dir", tmp_path / "data", "--out", tmp_path / "run", code=2)
    assert "no entry for column 'Others'" in done.stderr
    assert not (tmp_path / "run").exists()


def test_a_table_of_properties_takes_no_methods() -> None:
    says = bench("paper", "dmf-synch-2023", "table2", "-m", "spectral", code=2).stderr
    assert "-m adds methods to a table of scenes or a figure of curves" in says
    assert bench("paper", "dmf-synch-2023", "table2", "--dry-run").stdout == "nothing has to run\n"


def test_a_figure_with_bands_over_two_seeds(layout_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    done = bench("paper", layout_file, "f", "--seeds", 2, "--out", out, "--format", "csv")
    points = pd.read_csv(io.StringIO(done.stdout))
    assert list(zip(points["n"], points["missing"], strict=True))[:4] == [(12, 0.2), (12, 0.5), (16, 0.2), (16, 0.5)]
    assert (points["seeds"] == 2).all()
    assert (points["half_width_deg"] > 0).all()
    means = points.groupby("curve")["mean_deg"].mean()
    assert means["clairvoyant"] < 2 < means["tree"]
    assert {p.name for p in (out / "plots").iterdir()} == {"f.png", "f.pdf", "f.svg", "f.csv"}
    pd.testing.assert_frame_equal(pd.read_csv(out / "plots" / "f.csv"), points)

    records = pd.read_csv(io.StringIO(bench("table", out, "--format", "csv").stdout))
    one = records[(records["instance"] == "n12-missing0.2-noise1.0") & (records["method"] == "spanning-tree")]
    assert points["mean_deg"].iloc[0] == pytest.approx(one["mean_deg"].mean())
    assert set(records.loc[records["method"] == "spectral", "instance"].str.endswith("-clairvoyant")) == {True}


def test_the_bound_is_drawn_where_least_squares_attains_it(layout_file: Path, tmp_path: Path) -> None:
    done = bench("paper", layout_file, "b", "--seeds", 4, "--out", tmp_path / "run", "--format", "csv")
    points = pd.read_csv(io.StringIO(done.stdout)).set_index(["noise_deg", "curve"])["rms_deg"].unstack()
    assert (points["least squares"] / points["bound"]).to_numpy() == pytest.approx(1, abs=0.12)
    assert (points["bound"] < points["spectral"]).all()
    assert points["bound"].loc[4] / points["bound"].loc[2] == pytest.approx(2, rel=0.1)
    records = pd.read_csv(io.StringIO(bench("table", tmp_path / "run", "--align", "chordal", "--format", "csv").stdout))
    squares = records[records["method"] == "l1-irls"].groupby("instance")["rms_deg"].apply(lambda e: (e**2).mean())
    assert np.sqrt(squares).tolist() == pytest.approx(points["least squares"].tolist())


def test_what_differs_from_the_published_properties_is_bold() -> None:
    table = PropertyTable(
        title="Needs",
        columns={"supervised": "supervised"},
        published={"Tree": {"supervised": True}, "Elsewhere": {"supervised": True}},
        declared={"Tree": "spanning-tree", "Spectral": "spectral"},
    )
    text, _ = table.compare(load_layout("dmf-synch-2023").sources, Computed("")).text("markdown")
    assert "| Tree | spanning-tree | **no** | **yes** |" in text
    assert "| Elsewhere | – | – | yes |" in text
    assert "| Spectral | spectral | no | – |" in text


def test_papers_are_listed_with_their_items() -> None:
    listed = bench("list", "papers").stdout
    assert "dmf-synch-2023" in listed
    assert all(f"{item}: " in listed for item in ("table1", "table2", "fig3", "claims", "thin", "speedup"))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("dmf-synch-2032", "table1"), "did you mean 'dmf-synch-2023'?"),
        (("dmf-synch-2023", "tabel1"), "did you mean 'table1'?"),
        (("absent.toml", "table1"), "there is no paper 'absent.toml'"),
    ],
)
def test_unknown_names_are_one_sentence(arguments: tuple[str, str], says: str) -> None:
    done = bench("paper", *arguments, code=2)
    assert says in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("highlight_deg = 0.5", 'highlight_deg = "much"', "highlight_deg must be"),
        ("highlight_deg = 0.5", "", "key 'highlight_deg' is missing"),
        ('kind = "scenes"', 'kind = "scene"', "kind must be one of"),
        ('statistic = "median_deg"\n', 'statistic = "median"\n', "statistic must be 'mean_deg' or 'median_deg'"),
        ('alignment = "l1"\nhigh', 'alignment = "l2"\nhigh', "did you mean 'l1'?"),
        ("values = [12, 16]", "value = [12, 16]", "unknown key 'value'; did you mean 'values'?"),
        ('title = "A paper"', "title = A paper", "is not valid TOML"),
    ],
)
def test_a_layout_that_is_not_one_says_where(layout_file: Path, old: str, new: str, says: str) -> None:
    layout_file.write_text(LAYOUT.replace(old, new))
    with pytest.raises(InputError, match=r"a-paper\.toml") as caught:
        load_layout(str(layout_file))
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("2.3", "3x", "t.csv:3: '3x' in column 'Ours' is not a number"),
        ("2.3", "2,3", "t.csv:3: 8 cells where there are 7 columns"),
        (",source", ",sauce", "has no column 'source'"),
        ("Theirs", "Others", "no entry for column 'Others'"),
        ("Alamo", "Alamos", "no entry for 'Alamos'"),
    ],
)
def test_published_numbers_that_do_not_fit_say_where(layout_file: Path, old: str, new: str, says: str) -> None:
    layout = load_layout(str(layout_file))
    table = layout.item("t")
    assert isinstance(table, SceneTable)
    (layout_file.parent / "t.csv").write_text(PUBLISHED.replace(old, new))
    with pytest.raises(InputError) as caught:
        table.compare(layout.sources, Computed("l1"))
    assert says in str(caught.value)


def test_curves_group_what_has_to_run_by_dataset(layout_file: Path) -> None:
    plot = load_layout(str(layout_file)).item("f")
    assert isinstance(plot, CurvePlot)
    plain, clairvoyant = plot.suites("p")
    assert plain.methods == ("spanning-tree",)
    assert clairvoyant.methods == ("spectral",)
    assert clairvoyant.datasets[0] == "erdos-renyi[noise_deg=1,outliers=0.4,n=12,missing=0.2,clairvoyant=true]"
