"""What the report says of one scene: who is turned and why, the graph, cycles, edge weights and costs."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from graphs import random_edges, simulated
from runs import Made, made_run
from scenes import load, part_of

from bench.core import so3
from bench.core.problem import Floats, Instance, Problem
from bench.datasets.folded import Folded
from bench.reporting.html import graph
from bench.reporting.html.case import Case, Solved
from bench.reporting.html.embed import compact
from bench.reporting.html.page import render
from bench.reporting.html.scene import sections, sections_of
from bench.reporting.html.section import Section
from bench.running.run import Options, Run
from bench.scoring.results import Results, score, under_every_rule
from bench.storage.store import Store

PLACE = ("toy", "P", "all")
TURNED = "Parts of the scene that are turned as one piece"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Store, Results, list[Section]]:
    """Real methods on a scene of which a quarter is folded by 25 degrees."""
    out: Path = tmp_path_factory.mktemp("run")
    methods = ["l1-irls", "weiszfeld", "spectral", "spanning-tree"]
    made = Run("quick", methods, ["folded[outliers=0.0]"], Options(out=out, timeout_s=60.0))
    made.prepare()
    for _ in made.execute():
        pass
    results = score(made.store)
    (place,) = results.errors
    return made.store, results, sections(made.store, results, place)


def section(found: list[Section], start: str) -> Section:
    (one,) = [s for s in found if s.title.startswith(start)]
    return one


def made_sections(folder: Path, *methods: Made) -> list[Section]:
    store = made_run(folder, ["P"], methods, cameras=120, share=0.1)
    return sections(store, score(store), PLACE)


class TestFoldedScene:
    def test_the_page_names_the_cameras_and_the_angle_in_words(self, run: tuple[Store, Results, list[Section]]) -> None:
        part = part_of(load(Folded(outliers=0.0)))
        words, cameras, alignment = section(run[2], TURNED).paragraphs[:3]
        assert "50 of 200 cameras (25 %) are turned as one piece" in words
        assert "In the estimates of" in words
        assert "the measurements are turned, or the truth is" in words
        named = [int(word) for word in cameras.removeprefix("Cameras: ").removesuffix(".").split(", ")]
        assert len(np.intersect1d(named, part)) >= 0.95 * max(len(named), len(part))
        (table,) = section(run[2], TURNED).tables
        angle = {row[0]: row[2] for row in table.rows}
        assert angle["l1-irls"] == pytest.approx(25, abs=2)
        assert f"by {angle['weiszfeld']:.1f}° to {angle['l1-irls']:.1f}°" in words
        assert "depend on the alignment" in alignment

    def test_the_report_flags_that_the_ranking_depends_on_the_alignment(
        self, run: tuple[Store, Results, list[Section]]
    ) -> None:
        page = render(run[0], under_every_rule(*run[:2]))
        assert "Who is best depends on the alignment" in page
        assert "The order of the methods depends on the alignment" in page
        assert "are turned as one piece by" in page

    def test_wrong_edges_that_agree_are_told(self, run: tuple[Store, Results, list[Section]]) -> None:
        assert "wrong edges agree with each other" in section(run[2], "Residuals of cycles").paragraphs[1]

    def test_edge_weights_are_held_against_the_outliers(self, run: tuple[Store, Results, list[Section]]) -> None:
        frame = run[1].frame.set_index("method")
        drawn = section(run[2], "Do the edge weights").figure
        assert drawn is not None
        assert {trace["name"].split(":")[0] for trace in drawn["data"]} == {"l1-irls", "spanning-tree"}
        for trace in drawn["data"]:
            area = np.sum(np.diff(trace["x"]) * (trace["y"][1:] + trace["y"][:-1]) / 2) / 1e4
            assert area == pytest.approx(frame["roc_auc"][trace["name"].split(":")[0]], abs=0.01)

    def test_costs_tell_the_wrong_optimum_from_a_search_that_stopped(
        self, run: tuple[Store, Results, list[Section]]
    ) -> None:
        found = section(run[2], "The cost at the estimate")
        verdicts = {row[0]: row[-1] for row in found.tables[0].rows}
        assert verdicts["l1-irls"] == "lower in both"
        assert verdicts["spanning-tree"] == "higher in both"
        assert "spanning-tree stopped above the truth's cost" in found.paragraphs[1]

    def test_the_worst_are_listed(self, run: tuple[Store, Results, list[Section]]) -> None:
        best, worst = (s for s in run[2] if s.title.startswith("The graph under"))
        (place,) = run[1].errors
        for one, method in ((best, best.title.split()[3].rstrip(",")), (worst, "spanning-tree")):
            (errors,) = run[1].errors[place][method, ""]
            cameras, edges = one.tables
            assert [row[0] for row in cameras.rows] == np.argsort(-errors, kind="stable")[: len(cameras.rows)].tolist()
            assert cameras.rows[0][2] == pytest.approx(errors.max())
            residuals = [row[1] for row in edges.rows]
            assert residuals == sorted(residuals, reverse=True)  # type: ignore[type-var]


class TestWhoseFold:
    def test_of_one_method_alone(self, tmp_path: Path) -> None:
        found = made_sections(tmp_path / "run", Made("turned", fold_deg=25), Made("a"), Made("b", 2.0))
        words = section(found, TURNED).paragraphs[0]
        assert re.match(
            r"Only in the estimate of turned, (29|30) of 120 cameras \(2[45] %\) are turned .* by 25\.", words
        )
        assert words.endswith("the measurements are not to blame.")

    def test_of_several_by_different_angles(self, tmp_path: Path) -> None:
        turned = [Made("x", fold_deg=25), Made("y", fold_deg=25.5), Made("z", fold_deg=40)]
        words = section(made_sections(tmp_path / "run", *turned, Made("a")), TURNED).paragraphs[0]
        assert re.match(r"In the estimates of 3 of 4 methods, (29|30) of 120 cameras", words)
        assert "° (z); by 2" in words
        assert "° (y and x)" in words or "° (x and y)" in words

    def test_of_nobody(self, tmp_path: Path) -> None:
        found = made_sections(tmp_path / "run", Made("a"), Made("b", 2.0))
        assert section(found, TURNED).paragraphs[0].startswith("None: in no estimate")
        assert len(section(found, "The cost").tables[0].rows) == 2

    def test_nothing_ended_well(self, tmp_path: Path) -> None:
        assert made_sections(tmp_path / "run", Made("a", status="timeout")) == []


def case_of(problem: Problem, truth: Floats | None, rotations: Floats) -> Case:
    n, m = problem.n, problem.m
    residuals = np.degrees(problem.residuals(rotations))
    solved = Solved(("a", ""), "a", rotations, None, np.full(n, np.nan), residuals, (), {})
    return Case("p", Instance(problem, truth, "p"), np.full(m, np.nan), (solved,), False)


class TestWithoutTruth:
    def test_the_graph_is_coloured_by_residual_and_nothing_is_said_of_errors(self) -> None:
        problem, truth = simulated(random_edges(50, 0.2), noise_deg=2)
        rotations = truth.copy()
        rotations[7] = np.nan
        drawn, cycles = sections_of(case_of(problem, None, rotations), {})
        assert drawn.title == "The graph under a, the best by median residual"
        assert "no ground truth" in drawn.paragraphs[0]
        assert [table.caption for table in drawn.tables] == ["Worst edges of a"]
        assert drawn.figure is not None
        (cameras,) = (trace for trace in drawn.figure["data"] if trace["name"] == "cameras")
        residuals = problem.residuals(rotations)
        for camera in (0, 20):
            own = np.degrees(np.nanmedian(residuals[(problem.edges == camera).any(axis=1)]))
            assert cameras["marker"]["color"][camera] == pytest.approx(own, rel=0.01)
        assert np.isnan(cameras["marker"]["color"][7])
        assert len(cycles.paragraphs) == 1

    def test_a_graph_without_triangles_has_no_cycles_to_show(self) -> None:
        problem, truth = simulated(np.array([[0, 1], [1, 2]]))
        (drawn,) = sections_of(case_of(problem, None, truth), {})
        assert "all edges" in drawn.paragraphs[0]


class TestGraph:
    def test_places_fit_the_grid_and_tell_the_parts_apart(self) -> None:
        instance = load(Folded(outliers=0.0))
        placed = graph.layout(instance.problem)
        assert (placed.min(), placed.max()) == (0, graph.GRID)
        np.testing.assert_array_equal(placed, graph.layout(instance.problem))
        inside = np.isin(np.arange(200), part_of(instance))
        between = np.linalg.norm(placed[inside].mean(axis=0) - placed[~inside].mean(axis=0))
        assert between > placed[inside].std(axis=0).max()

    @pytest.mark.parametrize("edges", [[[0, 1]], [[0, 1], [2, 3]], random_edges(12, 0.0).tolist()])
    def test_tiny_and_disconnected_graphs_are_placed(self, edges: list[list[int]]) -> None:
        problem, _ = simulated(np.array(edges))
        assert np.unique(graph.layout(problem), axis=0).shape == (problem.n, 2)

    def test_a_large_graph_stays_small_on_disk(self) -> None:
        problem, truth = simulated(random_edges(1000, 0.01), noise_deg=2, outliers=0.2)
        rotations = so3.exp(0.02 * np.random.default_rng(0).standard_normal((1000, 3))) @ truth
        solved = case_of(problem, truth, rotations).solved[0]
        errors = np.degrees(so3.angle_between(rotations, truth))
        drawn = compact(graph.figure(problem, graph.layout(problem), solved, errors, "error"))
        assert len(json.dumps(drawn, separators=(",", ":"))) < 25_000
        layers = [trace for trace in drawn["data"] if trace["mode"] == "lines"]
        assert sum(trace["x"].count(None) for trace in layers) == graph.EDGES
        assert layers[-1]["name"] == "15° and more"
