"""Tables of means over the graphs of a collection."""

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import bench as command
from test_reporting import row

from bench.reporting.tables.collections import collection_grids, collection_table, has_collections
from bench.reporting.tables.render import render
from bench.suite.experiment import load_suite

METHODS = {"good": ("l1-irls", "L1-IRLS", ""), "bad": ("spectral", "Spectral", "")}


def frame(graphs: int, **failed: int) -> pd.DataFrame:
    """Graphs of one collection: a good method with half of its cameras within 5 degrees, a bad one with none."""
    rows = []
    for k in range(graphs):
        for name, method in METHODS.items():
            errors = np.array([1.0, 2.0, 8.0 + k, 9.0 + k]) + (0 if name == "good" else 60 + 5 * k)
            more = {"n": 4, "collection": "Rooms"}
            more |= {"status": "timeout(60 s)"} if failed.get(name) == k else {"errors": errors}
            rows.append(row(f"scan{k}", method, **more))
    return pd.DataFrame(rows).assign(dataset="scan-graph", protocol="all")


def test_means_are_over_graphs_and_what_failed_counts_as_nothing() -> None:
    table = collection_table(frame(2), {}).set_index("method")
    assert table.loc["l1-irls", ["graphs", "ended"]].tolist() == [2, 2]
    assert table.loc["l1-irls", "mean_deg"] == pytest.approx((5 + 5.5) / 2)
    assert table.loc["l1-irls", "within_10_deg"] == pytest.approx((1.0 + 0.75) / 2)
    assert table.loc["l1-irls", "auc_5_deg"] == pytest.approx((0.8 + 0.6) / 4)
    failed = collection_table(frame(2, good=0), {}).set_index("method")
    assert failed.loc["l1-irls", ["graphs", "ended"]].tolist() == [2, 1]
    assert failed.loc["l1-irls", "within_10_deg"] == pytest.approx(0.75 / 2)
    assert np.isnan(failed.loc["l1-irls", "mean_deg"])
    assert failed.loc["spectral", "within_10_deg"] == 0


def test_the_best_share_comes_first_and_is_bold_where_graphs_are_enough() -> None:
    (few,) = collection_grids(frame(3), {})
    assert few.caption == "scan-graph / Rooms: means over 3 graphs of 4 cameras, l1 alignment, protocol all"
    assert [facts for facts, _ in few.rows] == [("l1-irls", "3/3"), ("spectral", "3/3")]
    assert not any(cell.bold for _, cells in few.rows for cell in cells)
    assert any("Fewer than 20 graphs" in note for note in few.notes)
    (many,) = collection_grids(frame(25, bad=4), {})
    assert [[cell.bold for cell in cells].count(True) for _, cells in many.rows] == [1, 0]
    assert "spectral: timeout(60 s) on 1 of 25 graphs" in many.notes


def test_graphs_without_truth_or_collection_have_tables_of_their_own() -> None:
    alone = pd.DataFrame([row("garage", METHODS["good"], n=9), row("torus", METHODS["good"], n=9)])
    assert not has_collections(alone)
    assert not has_collections(frame(1))
    grids = collection_grids(pd.concat([frame(2), alone.assign(collection=None)]), {})
    assert [grid.caption.split(":")[0] for grid in grids] == ["scan-graph / Rooms", "1dsfm / garage", "1dsfm / torus"]
    assert grids[1].caption.endswith("no ground truth: edge residuals, not errors")
    assert [head for head, _ in grids[1].methods] == ["residual mean °", "residual median °", "time s"]


@pytest.mark.parametrize("style", ["console", "markdown", "latex", "csv"])
def test_every_format(style: str) -> None:
    text, notes = render(frame(2), {}, ["a note"], style, by="collection")
    assert "l1-irls" in text
    if style == "csv":
        assert notes == ("a note",)
        assert len(pd.read_csv(io.StringIO(text))) == 2
    else:
        assert "a note" in text
        assert "87.5" in text


SCANS = '''
from dataclasses import dataclass
import numpy as np
from bench import Instance, Problem, Source, dataset, so3

@dataset("scans", title="Scans")
@dataclass(frozen=True)
class Scans:
    """Three triangles of one collection."""
    def sources(self, data_dir, seed):
        for k in range(3):
            yield Source(f"scan{k}", str(k), lambda k=k: make(k))

def make(k):
    truth = so3.random(np.random.default_rng(k), 4)
    edges = np.array([[0, 1], [0, 2], [1, 2], [2, 3], [0, 3]])
    i, j = edges.T
    problem = Problem(4, edges, truth[i] @ truth[j].transpose(0, 2, 1))
    return Instance(problem, truth, f"scan{k}", revision=str(k), collection="Triangles")
'''


def test_a_run_of_a_collection_shows_it_together(tmp_path: Path) -> None:
    (tmp_path / "scans.py").write_text(SCANS)
    out = tmp_path / "run"
    done = command("run", "-m", "spanning-tree", "-d", "scans", "--plugin", tmp_path / "scans.py", "--out", out)
    assert "scans / Triangles: means over 3 graphs of 4 cameras" in done.stdout
    assert "scans / scan0" not in done.stdout
    assert {path.name for path in (out / "tables").iterdir()} == {
        f"{name}-l1.{ending}" for name in ("table", "collections") for ending in ("txt", "md", "csv", "tex")
    }
    assert "scans / scan0" in command("table", out, "--by", "scene").stdout
    assert "scans / Triangles" in command("table", out).stdout
    assert command("table", out, "--format", "csv").stdout.startswith("dataset,instance,")
    assert command("table", out, "--format", "csv", "--by", "collection").stdout.startswith("dataset,collection,")


def test_the_suite_of_all_is_that_of_every_kind_of_real_graph() -> None:
    kinds = [load_suite(name) for name in ("1dsfm", "registration", "images", "slam")]
    everything = load_suite("all")
    assert list(everything.datasets) == [text for kind in kinds for text in kind.datasets]
    assert set(load_suite("methods").methods) <= set(everything.methods)
