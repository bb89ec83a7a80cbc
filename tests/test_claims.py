"""A paper's sentences as tested comparisons, and the time of its recipe."""

import io
from pathlib import Path

import pandas as pd
import pytest
from commands import bench
from scenes import write_scene

from bench.core.errors import InputError
from bench.papers.layout import load_layout

LAYOUT = """
title = "A paper"

[c]
kind = "claims"
title = "Claims"
alignment = "l1"
published = "t.csv"
seeds = 6
forms = { "plain" = "spectral[normalised=false]" }

[[c.statements]]
sentence = "beats a tree"
statistic = "mean_deg"
datasets = ["erdos-renyi[n=14,outliers=0.0]"]
forms = ["plain"]
left = [{}]
right = [{ method = "spanning-tree" }]

[[c.statements]]
sentence = "outliers help"
statistic = "mean_deg"
datasets = ["erdos-renyi[n=14]"]
forms = ["plain"]
left = [{ dataset = { outliers = 0.4 } }]
right = [{ dataset = { outliers = 0.0 } }]

[[c.statements]]
sentence = "as good as Theirs"
statistic = "median_deg"
margin_deg = 0.5
datasets = ["1dsfm[protocol=truth-subgraph]"]
forms = ["plain"]
left = [{}]
right = [{ published = "Theirs" }]

[s]
kind = "speedup"
title = "Faster"
dataset = "erdos-renyi[n=12]"
method = "dmf-synch[iterations=20]"
recipe = "dmf-synch[preset=paper,depth=2,iterations=20,checkpoint_every=10]"
iterations = 1000
curves = "curves.csv"
chosen = { depth = 2 }
alignment = "l1"
"""
PUBLISHED = """scene,n_cameras,edges_percent,hardness,Theirs,source
Ellis Island,9,50,0.1000,1.3,here
Madrid Metropolis,341,31,0.0029,1.7,here
Alamo,577,50,0.0017,,here
"""
CURVES = """depth,iteration,mean_deg,median_deg
2,0,90,80
2,500,1.5,1.25
2,1000,3.5,2.5
3,500,1.0,0.5
"""


@pytest.fixture
def layout_file(tmp_path: Path) -> Path:
    (tmp_path / "t.csv").write_text(PUBLISHED)
    (tmp_path / "curves.csv").write_text(CURVES)
    path = tmp_path / "a-paper.toml"
    path.write_text(LAYOUT)
    return path


def test_sentences_are_judged_by_pairs_and_by_independent_samples(layout_file: Path, tmp_path: Path) -> None:
    write_scene(tmp_path / "data" / "Ellis_Island", images=12)
    write_scene(tmp_path / "data" / "Madrid_Metropolis", images=14)
    command = ("paper", layout_file, "c", "--data-dir", tmp_path / "data", "--out", tmp_path / "run")
    frame = pd.read_csv(io.StringIO(bench(*command, "--format", "csv").stdout))
    honest = frame[frame["rule"] == "honest"].set_index("sentence")
    assert honest["verdict"].to_dict() == {
        "beats a tree": "holds",
        "outliers help": "does not hold",
        "as good as Theirs": "cannot tell",
    }
    assert honest["pairs"].tolist() == [6, 0, 2]
    scenes = honest.loc["as good as Theirs"]  # two scenes, and three comparisons to correct for
    assert 0.05 < scenes["p_holds"] < 0.15
    assert scenes["right_deg"] == pytest.approx((1.3 + 1.7) / 2)
    assert scenes["left_deg"] == pytest.approx(scenes["right_deg"] + scenes["difference_deg"])
    without_checkpoints = frame.groupby("sentence")["left_deg"].nunique()
    assert (without_checkpoints == 1).all()
    shown = " ".join(bench(*command, "--format", "markdown").stdout.split())
    assert "| **holds** |" in shown
    assert "honest, plain: “outliers help”: 1 does not hold (of 1)." in shown


def test_the_oracles_pick_is_another_iterate(layout_file: Path, tmp_path: Path) -> None:
    """Of a dense product that is run to its end, the oracle's iterate is better."""
    text = LAYOUT.replace("spectral[normalised=false]", "dmf-synch[preset=dense,depth=2,stop=limit,iterations=2500]")
    layout_file.write_text(text.replace("seeds = 6", "seeds = 2"))
    done = bench("paper", layout_file, "c", "--out", tmp_path / "run", "--data-dir", tmp_path, "--format", "csv")
    frame = pd.read_csv(io.StringIO(done.stdout)).set_index(["sentence", "rule"])
    assert frame.loc[("outliers help", "oracle"), "left_deg"] < frame.loc[("outliers help", "honest"), "left_deg"]
    assert "1dsfm" in done.stderr


def test_the_time_of_a_recipe_is_that_of_its_iterations(layout_file: Path, tmp_path: Path) -> None:
    done = bench("paper", layout_file, "s", "--out", tmp_path / "run", "--format", "csv")
    ours, recipe = pd.read_csv(io.StringIO(done.stdout)).itertuples()
    assert recipe.total_s == pytest.approx(1000 * recipe.iteration_s)
    assert ours.times_less == pytest.approx(recipe.total_s / ours.total_s)
    assert (recipe.mean_deg, recipe.median_deg) == (1.5, 1.25)
    assert "times less" in bench("paper", layout_file, "s", "--out", tmp_path / "run").stdout

    (layout_file.parent / "curves.csv").write_text(CURVES.replace("2,", "4,"))
    refused = bench("paper", layout_file, "s", "--out", tmp_path / "run", code=2)
    assert "has no rows with depth=2" in refused.stderr


def test_a_form_that_is_not_there_says_where(layout_file: Path) -> None:
    layout_file.write_text(LAYOUT.replace('forms = ["plain"]', 'forms = ["plane"]'))
    with pytest.raises(InputError, match=r"a-paper\.toml: c: unknown form 'plane'; did you mean 'plain'\?"):
        load_layout(str(layout_file))


def test_what_takes_hours_is_shown_as_it_was_recorded(tmp_path: Path) -> None:
    command = ("paper", "dmf-synch-2023", "thin", "--out", tmp_path / "run")
    done = bench(*command, "--format", "csv")
    recorded = load_layout("dmf-synch-2023").sources.reference / "dmf-synch-2023/thin.csv"
    with recorded.open(encoding="utf-8") as file:
        assert pd.read_csv(io.StringIO(done.stdout)).equals(pd.read_csv(file))
    assert "recorded results; --compute computes them here" in done.stderr
    shown = " ".join(bench(*command).stdout.split())
    assert "(recorded); degrees" in shown
    assert "Recorded, not computed now: an earlier run, kept as dmf-synch-2023/thin.csv" in shown
    assert "two core-hours" in shown
    assert not (tmp_path / "run").exists()


def test_what_is_recorded_is_computed_where_it_is_asked_for(layout_file: Path, tmp_path: Path) -> None:
    layout_file.write_text(layout_file.read_text().replace("seeds = 6", 'recorded = "old.csv"\nseeds = 3'))
    command = ("paper", layout_file, "c", "--out", tmp_path / "run", "--data-dir", tmp_path)
    assert "with recorded results" in bench(*command, code=2).stderr
    assert "Recorded" not in bench(*command, "--compute").stdout
    assert "Recorded" not in bench(*command).stdout  # all of it is done now


def test_recorded_results_that_are_none_are_refused(layout_file: Path, tmp_path: Path) -> None:
    (tmp_path / "old.csv").write_text("sentence,form\na,b\n")
    layout_file.write_text(layout_file.read_text().replace("seeds = 6", 'recorded = "old.csv"'))
    with pytest.raises(InputError, match=r"old.csv holds no recorded results: KeyError\('dataset'\)"):
        load_layout(str(layout_file)).item("c").read_recorded(load_layout(str(layout_file)).sources)
